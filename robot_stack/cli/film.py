"""film: a recorded ride as GIF or MP4."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robot_stack.cli.errors import WRONG_USE, CommandError, writing

if TYPE_CHECKING:
    from robot_stack.film.frames import Film
    from robot_stack.film.params import FilmParams
    from robot_stack.film.tracks import Story

_FORMATS = (".gif", ".mp4")


def film(
    recording: Annotated[Path, typer.Argument(help="Recording: folder or .mcap of the recorder.")],
    output: Annotated[
        list[Path] | None,
        typer.Option("--output", "-o", help="File to write, .gif or .mp4, or both; by default film.gif beside it."),
    ] = None,
    map_name: Annotated[
        str | None, typer.Option("--map", help="Map of the site; by default localization's, '' for none.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(min=1.0, max=600.0, help="Length of the film.")] = None,
    width: Annotated[int | None, typer.Option(min=200, max=1600, help="Pixels across.")] = None,
) -> None:
    """Draw a recorded ride as a film: robot, wheelchair, people, plan and the site's map. Needs no display and no GPU.

    People come from the simulation's ground truth if recorded; for a real ride, from perception.
    """
    from robot_stack.core.config import load
    from robot_stack.film.params import FilmParams

    files = output or [(recording if recording.is_dir() else recording.parent) / "film.gif"]
    for file in files:
        if file.suffix not in _FORMATS:
            raise CommandError(f"{file}: a film ends in {' or '.join(_FORMATS)}", WRONG_USE)
    params = load(FilmParams, "film")
    chosen: dict[str, Any] = {} if seconds is None else {"length_s": seconds}
    if width is not None:
        chosen |= {
            "width_px": width - width % 2,
            "height_px": 2 * round(0.5 * width * params.height_px / params.width_px),
        }
    make_film(recording, files, load(FilmParams, "film", chosen), map_name)


def make_film(
    recording: Path,
    files: list[Path],
    params: FilmParams,
    map_name: str | None,
    report: Callable[[str], Any] = typer.echo,
) -> None:
    """Writes the files and prints their paths. Raises CommandError, ConfigError."""
    from robot_stack.cli.film_recording import read_story
    from robot_stack.cli.tables import progress_bar

    with progress_bar("reading") as show:
        story, warnings = read_story(recording, params.sample_hz, show)
    for warning in warnings:
        typer.echo(warning, err=True)
    pictures = _pictures(_film(story, params, map_name))
    _save(files, pictures, params)
    for file in files:
        report(f"{file} ({file.stat().st_size / 1e6:.1f} MB)")


def _film(story: Story, params: FilmParams, map_name: str | None) -> Film:
    import numpy as np

    from robot_stack.core.robot import load_robot
    from robot_stack.core.robot_shape import load_robot_shape
    from robot_stack.core.site_map import chosen_map, load_map
    from robot_stack.film.frames import Film
    from robot_stack.film.site import drawn_site, empty_site, unmapped

    name = chosen_map(map_name)
    if name:
        known = load_map(name)
        site = drawn_site(known, params.wall_height_m)
        story.obstacles = [(at_s, unmapped(points, known.grid)) for at_s, points in story.obstacles]
    else:
        site = empty_site(story.robot.line(np.inf), margin_m=12.0)
    return Film(story, site, load_robot(), load_robot_shape(), params)


def _pictures(film: Film) -> list[Any]:
    from robot_stack.cli.film_files import Lettering
    from robot_stack.cli.tables import progress_bar

    lettering, pictures = Lettering(), []
    with progress_bar("drawing") as report:
        for index, (time_s, picture) in enumerate(film.frames()):
            clock = f"{int(time_s) // 60}:{int(time_s) % 60:02d}"
            pictures.append(lettering.write(picture, film.caption(index), clock))
            report(index + 1, film.count)
    return pictures


def _save(files: list[Path], pictures: list[Any], params: FilmParams) -> None:
    from robot_stack.cli.film_files import save_gif, save_mp4

    for file in files:
        with writing(file):
            file.parent.mkdir(parents=True, exist_ok=True)
            if file.suffix == ".gif":
                save_gif(file, pictures, params.frame_hz, params.gif_colours)
            else:
                save_mp4(file, pictures, params.frame_hz)
