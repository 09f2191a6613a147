"""Parameters of the marker detector, part of ``config/aruco_detector.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, Count, Fraction, Positive


class SearchParams(Config):
    """Finding and reading markers.

    threshold_windows_px: sizes of the adaptive threshold's window (odd); one is used at a time, the next after an image
    in which nothing was found. shrunk_side_px: where the markers are known to be large, the image is reduced until a
    side has at least this many pixels.
    """

    threshold_windows_px: Annotated[list[Annotated[int, Field(ge=3)]], Field(min_length=1)]
    threshold_constant: Positive
    smallest_side_px: Positive
    error_correction: Fraction
    border_error_share: Fraction
    shrunk_side_px: Annotated[float, Field(ge=20.0)]
    region_margin_share: Positive
    region_margin_px: Positive
    full_search_every: Count
    forget_after: Count

    @model_validator(mode="after")
    def _windows_are_odd(self) -> SearchParams:
        if any(window % 2 == 0 for window in self.threshold_windows_px):
            raise ValueError("threshold_windows_px must be odd numbers")
        return self


class EdgeParams(Config):
    """Edge fit of a marker's sides.

    window_px: widest half window, coarse then fine. min_contrast: grey levels. min_contrast_share: of the side's median
    contrast. min_samples_share: of the samples taken along a side. end_share: of a side, left out at each end, where
    the corner rounds the edge. scatter_floor_px: lower bound of a side's scatter. systematic_px: error of a side that
    averaging does not reduce (lens model, print, neighbouring edges).
    """

    coarse_window_px: Annotated[float, Field(ge=2.0, le=16.0)]
    fine_window_px: Annotated[float, Field(ge=2.0, le=16.0)]
    min_contrast: Positive
    min_contrast_share: Fraction
    min_samples_share: Fraction
    end_share: Annotated[float, Field(ge=0.0, lt=0.4)]
    scatter_floor_px: Positive
    systematic_px: Positive


class ShutterParams(Config):
    """Rolling shutter. row_time_s: from one row to the next, 0 for a global shutter; stamps mean the middle row.

    The board's motion is taken from its poses in two images no farther apart than longest_gap_s; one that is faster
    than fastest_mps or fastest_radps is none.
    """

    row_time_s: Annotated[float, Field(ge=0.0, le=1e-4)]
    longest_gap_s: Positive
    fastest_mps: Positive
    fastest_radps: Positive


class PoseParams(Config):
    """Pose of a board.

    outlier_sigmas: a marker this far from the others' prediction is left out, if that lowers the rest's mean square
    error by outlier_gain; so is a side, if enough others are left. ambiguous_cost: two poses whose squared errors, in
    variances, differ by less are ambiguous. ambiguous_sigma_rad: so is an orientation with a larger standard deviation.
    quality_half_sigma_m: standard deviation of the position at quality 0.5. ambiguous_quality: upper limit of an
    ambiguous pose's quality.
    """

    outlier_sigmas: Positive
    outlier_gain: Annotated[float, Field(gt=1.0)]
    ambiguous_cost: Positive
    ambiguous_sigma_rad: Positive
    quality_half_sigma_m: Positive
    ambiguous_quality: Fraction


class DetectorParams(Config):
    """All parameters of the detector."""

    search: SearchParams
    edges: EdgeParams
    shutter: ShutterParams
    pose: PoseParams


class ArucoDetectorParams(Config):
    """All parameters of the node.

    always_on: detects independent of docking. linger_s: detection continues this long after DOCKED, for one more look
    at the board for its correction. pair_wait_s: longest wait of the image of the camera with markers for the other's.
    idle_camera_every: while the other camera has markers, only every n-th image of one without is searched.
    """

    always_on: bool
    linger_s: Annotated[float, Field(ge=0.0, le=10.0)]
    pair_wait_s: Annotated[float, Field(gt=0.0, le=0.1)]
    idle_camera_every: Count
    detector: DetectorParams
