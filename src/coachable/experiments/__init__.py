"""Many runs: what a study is, how it is run and resumed, and the folder it leaves behind."""
