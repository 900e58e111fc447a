import hashlib
import json
from dataclasses import asdict, replace

from hypothesis import given
from hypothesis import strategies as st

from app.core.definition import Definition, Option, flight_seed, titled


def test_the_digest_changes_with_every_field_and_only_then() -> None:
    one = Definition()
    others = [
        replace(one, strategy="manual"),
        replace(one, seed=2),
        replace(one, bounds={"kp": (1, 2)}),
        replace(one, options={"scaled": False}),
        replace(one, step_fraction=0.5),
        replace(one, safe_gains={"kp": 283, "ki": 13, "kd": 82}),
    ]
    assert len({one.digest(), *(other.digest() for other in others)}) == 7
    assert one.digest() == Definition().digest()
    assert len(one.digest()) == 64


def test_the_digest_of_a_definition_without_safe_gains_and_log_is_that_of_one_that_knows_of_none() -> None:
    fields = asdict(Definition())
    del fields["safe_gains"], fields["start"]["log"]
    canonical = json.dumps(fields, sort_keys=True, separators=(",", ":"))
    assert Definition().digest() == hashlib.sha256(canonical.encode()).hexdigest()


@given(st.integers(0, 2**64), st.integers(1, 200))
def test_flight_seeds_repeat_and_are_32_bit(seed: int, number: int) -> None:
    assert flight_seed(seed, number) == flight_seed(seed, number)
    assert 0 <= flight_seed(seed, number) < 2**32


def test_flight_seeds_differ_between_flights_and_campaigns() -> None:
    seeds = {flight_seed(seed, number) for seed in range(20) for number in range(1, 21)}
    assert len(seeds) == 400


def test_a_setting_has_the_title_and_unit_of_its_option_or_its_own_name() -> None:
    height = Option("height_m", "Height", 3.0, "m", 2.5, 10.0)
    assert list(titled({"height_m": 4.0, "former": 1}, [height])) == [("Height", "m", 4.0), ("former", "", 1)]
