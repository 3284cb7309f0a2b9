"""Latency of live windows without drawing: from packets in VMC protocol to those with which the
window sends its pose on, and from a changed pose of a program to the pose in the window. A frame
that is being drawn comes on top: with a graphics card, at most the 17 ms of a screen with 60 Hz.
The goal of 25 ms is for both together. Times are elapsed times, which other programs lengthen; the
processor times beside them do not depend on other programs.
"""

import math
import socket
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from live_screen import Screen

import viewer
from viewer.live.osc import bundles, message_bytes, messages_of
from viewer.live.vmc import UNITY, Receiver, Sender, packets_of, perform, performed, t_pose


def main(rounds: int = 200) -> None:
    """Print the times in milliseconds."""
    measure_steps(rounds)
    with tempfile.TemporaryDirectory() as folder:
        screen = Screen(Path(folder) / "window.json", viewer.load("body"), vmc=True)
        try:
            measure_vmc(screen, rounds)
            measure_program(screen, rounds)
        finally:
            screen.close()


def measure_steps(rounds: int) -> None:
    """Print the processor time of what happens to a performance, in one thread."""
    body = viewer.load("body")[0]
    how, receiver = t_pose(body.figure), Receiver("127.0.0.1", 0)
    packets = packets_of(performed(how, body.pose), 0.0)
    started = time.process_time()
    for _ in range(rounds):
        for data in packets:
            receiver.receive(data)
        body.pose = perform(how, body.pose, receiver.take())
        packets_of(performed(how, body.pose), 0.0)
    used = 1e3 * (time.process_time() - started) / rounds
    receiver.close()
    print(f"reading, posing, writing: {used:.1f} ms of processor time")


def measure_vmc(screen: Screen, rounds: int) -> None:
    """Send all bones, and wait for the window's own packets."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as back:
        back.bind(("127.0.0.1", 0))
        back.settimeout(10)
        screen.live.vmc_out = Sender("127.0.0.1", back.getsockname()[1])
        target = "127.0.0.1", screen.live.vmc_in.port
        walls, started = [], time.process_time()
        for number in range(rounds):
            angle = 0.1 + 0.002 * number
            turn = math.sin(angle / 2), math.cos(angle / 2)
            began = time.perf_counter()
            values = (0.0, 0.0, 0.0, 0.0, turn[0], 0.0, turn[1])
            bones = (message_bytes("/VMC/Ext/Bone/Pos", bone, *values) for bone in UNITY)
            for data in bundles(bones):
                back.sendto(data, target)
            while not any(
                arguments[:1] == ("Head",) and abs(abs(arguments[5]) - turn[0]) < 1e-5
                for _, arguments in messages_of(back.recv(2000))
            ):
                pass
            walls.append(1e3 * (time.perf_counter() - began))
        used = 1e3 * (time.process_time() - started) / rounds
    show("55 bones in, all bones out", walls, used)


def measure_program(screen: Screen, rounds: int) -> None:
    """Change a pose of a program, and wait until the window has it."""
    walls = []
    with viewer.connect(screen.path) as live:
        body = live["body"]
        started = time.process_time()
        for number in range(rounds):
            began = time.perf_counter()
            body.pose.figure_translation[0] = 0.001 * number
            live.update()
            while screen.state.scene[0].pose.figure_translation[0] != 0.001 * number:
                time.sleep(0.0)
            walls.append(1e3 * (time.perf_counter() - began))
        used = 1e3 * (time.process_time() - started) / rounds
    show("pose of a program", walls, used)


def show(what: str, walls: list[float], used: float) -> None:
    """Print a line."""
    middle, late = statistics.median(walls), float(np.quantile(walls, 0.95))
    print(f"{what}: median {middle:.1f} ms, 95 % {late:.1f} ms, {used:.1f} ms of processor time")


if __name__ == "__main__":
    main()
