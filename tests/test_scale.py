"""`Scale`: metres and seconds into cells and steps, and back."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from DroneSwarmSearch import Scale

SCALE = Scale(130, 13)
INF = math.inf

numbers = st.floats(-1e6, 1e6)
scales = st.builds(Scale, st.floats(0.1, 1e4), st.floats(0.1, 1e4))


def test_a_scale_by_hand():
    assert SCALE.vector((0.5, 1.0)) == pytest.approx((0.05, -0.1))
    assert SCALE.offset((260, 130)) == (2.0, -1.0)
    assert SCALE.cells(65) == 0.5 and SCALE.seconds(2) == 26
    assert [SCALE.whole_steps(seconds) for seconds in (0, 6.4, 6.5, 19.5, 3600)] == [
        0,
        0,
        1,
        2,
        277,
    ]
    assert SCALE.diffusion(5) == pytest.approx(2 * 5 * 13 / 130**2)


def test_a_drone_sees_one_cell_and_crosses_it_in_one_step():
    assert Scale.for_drone(speed=10, swath=130) == SCALE


@given(scales, st.tuples(numbers, numbers))
def test_velocities_have_an_inverse(scale, pair):
    assert scale.velocity(scale.vector(pair)) == pytest.approx(pair)


@given(scales, st.tuples(numbers, numbers), st.integers(1, 10_000))
def test_units_agree(scale, velocity, steps):
    """A velocity times a time is a displacement, and a variance is twice K times a time."""
    seconds = scale.seconds(steps)
    assert scale.whole_steps(seconds) == steps
    carried = [speed * steps for speed in scale.vector(velocity)]
    assert scale.offset([speed * seconds for speed in velocity]) == pytest.approx(carried)
    deviation = scale.cells(math.sqrt(2 * 3.0 * seconds))
    assert scale.diffusion(3.0) * steps == pytest.approx(deviation**2)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: Scale(0, 1), ValueError, "metres_per_cell must .*above 0, got 0"),
        (lambda: Scale(130, INF), ValueError, "seconds_per_step must .*got inf"),
        (lambda: Scale("130", 13), TypeError, "metres_per_cell must .*got '130'"),
        (lambda: Scale.for_drone(0, 130), ValueError, "speed must .*above 0, got 0"),
        (lambda: Scale.for_drone(10, None), TypeError, "swath must .*got None"),
        (lambda: SCALE.vector((1, INF)), ValueError, r"velocity\[1\] must .*got inf"),
        (lambda: SCALE.offset("12"), TypeError, "displacement must be two finite numbers"),
        (lambda: SCALE.cells(None), TypeError, "metres must .*got None"),
        (lambda: SCALE.whole_steps("1"), TypeError, "seconds must .*got '1'"),
        (lambda: SCALE.seconds(None), TypeError, "steps must .*got None"),
        (lambda: SCALE.diffusion(-1), ValueError, "diffusivity must .*at least 0, got -1"),
    ],
)
def test_bad_values_are_rejected(call, error, message):
    with pytest.raises(error, match=message):
        call()
