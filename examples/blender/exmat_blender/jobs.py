"""Precompute in the background: one job an object, asked now and then how far it is."""
import time

import bpy

from . import reading
from .asset import asset_of, made_of, notes
from .fault import Fault

EVERY = 0.2  # s
running = {}  # jobs, by the name of their object


class Running:
    """A job, and what its bundle is made of."""

    def __init__(self, job, made_of, remarks):
        self.job, self.made_of, self.remarks = job, made_of, remarks
        self.begin = time.monotonic()


def say(obj, message, failed=False):
    """In the panel."""
    obj.exmat.message, obj.exmat.failed = message, failed
    for window in bpy.context.window_manager.windows if bpy.context.window_manager else ():
        for area in window.screen.areas:
            area.tag_redraw()


def start(obj, scene):
    """Raises Fault."""
    reading.check_object(obj)
    if obj.name in running:
        raise Fault("It is being made already.")
    exmat = reading.exmat()
    out = reading.bundle_of(obj)
    shape, frame = reading.shape_of(obj), reading.frame_of(obj, scene)
    asset = asset_of(shape.mapped(frame.to_body), reading.body_settings(obj))
    try:
        job = exmat.precompute.start_bundle(asset, out, program=reading.program())
    except (exmat.Error, OSError) as error:
        raise Fault(str(error)) from None
    running[obj.name] = Running(job, made_of(shape, frame.stretch), notes(shape))
    say(obj, "Precompute has begun.")
    if not bpy.app.timers.is_registered(look):
        bpy.app.timers.register(look, first_interval=EVERY)


def look():
    """What has become of the jobs; the time until it is to be asked again, none where all have ended."""
    for name in list(running):
        now, obj = running[name], bpy.data.objects.get(name)
        if obj is None:
            cancel(name)
        elif now.job.poll():
            finish(name)
        elif now.job.latest is not None:
            say(obj, progress_of(now))
    return EVERY if running else None


def progress_of(now):
    latest = now.job.latest
    share = f": {100 * min(latest.done / latest.total, 1):.0f} %" if latest.total else ""
    return f"{latest.stage}{share}; {time.monotonic() - now.begin:.0f} s in all"


def finish(name):
    """Waits for the job and says how it ended."""
    now, obj = running.pop(name), bpy.data.objects.get(name)
    exmat = reading.exmat()
    try:
        report = now.job.result()
    except exmat.Error as error:
        if obj is not None:
            say(obj, "Cancelled." if isinstance(error, exmat.Cancelled) else str(error), not isinstance(error, exmat.Cancelled))
        return
    if obj is not None:
        obj.exmat.made_of = now.made_of
        if bpy.ops.ed.undo_push.poll():
            bpy.ops.ed.undo_push(message="Precompute")  # what is undone later leaves the bundle known
        say(obj, " ".join([f"The bundle has {report.sizes.modes} modes.", *now.remarks, *now.job.warnings]))


def wait(name):
    """Until the job has ended."""
    running[name].job.wait()
    finish(name)


def cancel(name):
    if name in running:
        running[name].job.cancel()
        finish(name)


def cancel_all():
    for name in list(running):
        cancel(name)


def unregister():
    cancel_all()
    if bpy.app.timers.is_registered(look):
        bpy.app.timers.unregister(look)
