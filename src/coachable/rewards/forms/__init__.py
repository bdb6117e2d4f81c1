"""Reward forms: how a behaviour pays."""

from coachable.rewards.forms.data import FORMS as FORMS
from coachable.rewards.forms.data import form_from_data as form_from_data
from coachable.rewards.forms.data import form_of as form_of
from coachable.rewards.forms.form import BoundForm as BoundForm
from coachable.rewards.forms.form import Payment as Payment
from coachable.rewards.forms.form import RewardForm as RewardForm
from coachable.rewards.forms.form import Step as Step
from coachable.rewards.forms.potential import Potential as Potential
from coachable.rewards.forms.tables import VARIANTS as VARIANTS
from coachable.rewards.forms.tables import Equation as Equation
from coachable.rewards.forms.tables import Released as Released
from coachable.rewards.forms.tables import Stay as Stay
from coachable.rewards.forms.tables import Variant as Variant
from coachable.rewards.forms.tables import reward_table as reward_table
