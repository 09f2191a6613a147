"""Rows of the engine's private matrices; the public ones are in ``robot_stack.wmx.axes``.

Plain integers, not enumerations: compiled code folds them into constants.
"""

from __future__ import annotations

from typing import Final

# float64 parameters, one row each (user units and seconds)
(
    COUNTS_PER_UNIT,  # signed by the polarity
    IN_POS_WIDTH,
    POS_SET_WIDTH,
    DELAYED_POS_SET_WIDTH,
    QUICK_STOP_DEC,
    ESTOP_DEC,
    ERROR_MOVING,
    ERROR_STOPPED,
    VELOCITY_ERROR_MOVING,
    VELOCITY_ERROR_STOPPED,
    SOFT_POSITIVE,
    SOFT_NEGATIVE,
    LS_DEC,
    LS_SLOW_DEC,
    PROFILE_DEC,  # of the running command, for Stop
    PROFILE_DEC_TIME,  # of the running command, if it gives a time instead
) = range(16)
N_PARAMS: Final = 16

# int64 work, one row each
(
    TICK,  # cycles since the plan was made
    SEGMENTS,  # of the plan
    RUN_CYCLES,  # left of a timed motion, 0 = endless
    SERVO_DELAY,  # cycles left until a servo-on request goes out
    CLEAR_CYCLES,  # cycles left of an alarm-clear request
    SERVO_OFF_AT_REST,  # switch the servo off when the running stop ends
    DELAYED_POS_SET_CYCLES,  # parameter
    DELAYED_POS_SET_COUNT,
    ERROR_STOPS,  # parameter: a following error stops the axis
    VELOCITY_ERROR_STOPS,  # parameter: a velocity following error stops the axis
    VELOCITY_ERROR_MOVING_CYCLES,  # parameter
    VELOCITY_ERROR_STOPPED_CYCLES,  # parameter
    VELOCITY_ERROR_COUNT,
    SOFT_POSITIVE_TYPE,  # parameter
    SERVO_OFF_ON_ALARM,  # parameter
    UNHOME_ON_SERVO_OFF,  # parameter
    OVERTRAVEL,  # parameter
    SPLINE,  # mark of the spline that carries the axis, 0 = none
    SOFT_NEGATIVE_TYPE,  # parameter
) = range(19)
N_WORK: Final = 19
