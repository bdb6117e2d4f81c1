"""The gait passport: everything that is known of one walker, made and shown."""
