"""One robot and its operators, connected by virtual links, on a virtual clock.

At every step the robot receives what has arrived, moves and reports. Then each operator receives, acts and
sends. Datagrams are sealed as on a real network.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.teleop.channels import Peer, operator_endpoint, robot_endpoint
from pilotfish.teleop.codec import Kind, priority
from pilotfish.teleop.endpoints import (
    receive_at_operator,
    receive_at_robot,
    send_from_operator,
    send_from_robot,
)
from pilotfish.teleop.messages import ReceivedMessage
from pilotfish.teleop.operator_site import OperatorSite, start_operator, step_operator
from pilotfish.teleop.operator_values import OperatorInput, OperatorSettings, OperatorView
from pilotfish.teleop.robot_site import RobotSite, start_robot
from pilotfish.teleop.robot_step import RobotStep, step_robot
from pilotfish.teleop.robot_values import RobotSettings, RobotState
from pilotfish.teleop.session_record import RobotRecorder
from pilotfish.teleop.virtual_clock import VirtualClock
from pilotfish.teleop.virtual_link import LinkSettings, VirtualLink
from pilotfish.validation import shorten_repr

KIND_BYTE = 1  # of a datagram
TRUE_CLOCK, PERFECT_LINK = VirtualClock(), LinkSettings()


@shorten_repr
@dataclass(frozen=True, slots=True)
class OperatorConnection:
    """How one operator is connected to the robot.

    Attributes:
        settings: Settings of the operator's site.
        forward: Link to the robot.
        backward: Link from the robot.
        clock: The operator's clock.
    """

    settings: OperatorSettings
    forward: LinkSettings = PERFECT_LINK
    backward: LinkSettings = PERFECT_LINK
    clock: VirtualClock = TRUE_CLOCK


class VirtualOperator:
    """Site, endpoint and links of one operator.

    Attributes:
        site: State of the site.
        endpoint: State of the channel.
        forward: Link to the robot.
        backward: Link from the robot.
        datagrams: Datagrams that were sent in the last step.
    """

    def __init__(self, connection: OperatorConnection, key: bytes, rng: np.random.Generator) -> None:
        """Start the site and its links.

        Args:
            connection: How the operator is connected.
            key: Key that the operator shares with the robot.
            rng: Generator of both links and of the challenges.
        """
        self.settings, self._clock, self._key = connection.settings, connection.clock, key
        forward_rng, backward_rng, self._rng = rng.spawn(3)
        self.forward = VirtualLink(connection.forward, forward_rng)
        self.backward = VirtualLink(connection.backward, backward_rng)
        self.restart()

    def restart(self) -> None:
        """Start again without memory, as a new process does."""
        self.site: OperatorSite = start_operator(self.settings)
        self.datagrams: tuple[bytes, ...] = ()
        self.endpoint = operator_endpoint(self.settings.number, self._key, self._rng.bytes(32))

    def step(self, time_ns: int, given: OperatorInput) -> OperatorView:
        """Return what is displayed after a step: receive, act and send.

        Args:
            time_ns: True time [ns].
            given: What the operator does.
        """
        arrived = self.backward.receive(time_ns)
        self.endpoint, received = receive_at_operator(self.endpoint, arrived)
        self.site, outgoing, view = step_operator(
            self.settings, self.site, self._clock.read(time_ns), received, given
        )
        self.endpoint, self.datagrams = send_from_operator(self.endpoint, outgoing)
        for datagram in self.datagrams:
            self.forward.send(time_ns, datagram, priority(Kind(datagram[KIND_BYTE])))
        return view


class VirtualSession:
    """Robot and operators on a virtual clock.

    Attributes:
        settings: Settings of the robot's site.
        site: State of the robot's site.
        endpoint: State of its channels.
        operators: Operators by number.
        received: Messages of the last step, as the robot's site was given them.
        time: Time of the robot's clock at the last step [ns].
    """

    def __init__(
        self,
        settings: RobotSettings,
        connections: Sequence[OperatorConnection],
        robot: RobotState,
        rng: np.random.Generator,
        *,
        time_ns: int = 0,
        clock: VirtualClock = TRUE_CLOCK,
        recorder: RobotRecorder | None = None,
    ) -> None:
        """Start both sites.

        Args:
            settings: Settings of the robot's site.
            connections: How each operator is connected.
            robot: What the robot senses.
            rng: Generator of links, keys and challenges.
            time_ns: True time [ns].
            clock: The robot's clock.
            recorder: Recorder of the robot's site; None for none.

        Raises:
            InvalidInput: If an operator is not among the peers of the robot.
        """
        numbers = [connection.settings.number for connection in connections]
        if unknown := [number for number in numbers if number not in settings.peers]:
            raise InvalidInput(
                f"operator {unknown[0]} is not among the peers, expected one of {settings.peers}"
            )
        self.settings, self._clock, self._rng, self._recorder = settings, clock, rng, recorder
        self._peers = tuple(
            Peer(number, rng.bytes(32), number in settings.operators) for number in settings.peers
        )
        keys = {peer.number: peer.key for peer in self._peers}
        self.operators = {
            connection.settings.number: VirtualOperator(connection, keys[connection.settings.number], rng)
            for connection in connections
        }
        self.received: tuple[ReceivedMessage, ...] = ()
        self.restart_robot(time_ns, robot)

    def restart_robot(self, time_ns: int, robot: RobotState) -> None:
        """Start the robot's site again without memory, as a new process does.

        Args:
            time_ns: True time [ns].
            robot: What the robot senses.
        """
        self.time = self._clock.read(time_ns)
        self.site: RobotSite = start_robot(self.settings, self.time, robot)
        if self._recorder:
            self._recorder.start(self.settings, self.time, robot)
        boot, limits = int(self._rng.integers(1, 2**64, dtype=np.uint64)), self.settings.contract
        self.endpoint = robot_endpoint(self._peers, boot, limits.max_budget, limits.max_jitter)

    def step_robot(self, time_ns: int, robot: RobotState, injected: Sequence[bytes] = ()) -> RobotStep:
        """Return the step of the robot: receive, move and report.

        Args:
            time_ns: True time [ns].
            robot: What the robot senses.
            injected: Datagrams of others that arrive now.
        """
        arrived = [
            datagram for operator in self.operators.values() for datagram in operator.forward.receive(time_ns)
        ]
        self.endpoint, self.received, replies = receive_at_robot(self.endpoint, [*arrived, *injected])
        self.time = self._clock.read(time_ns)
        step = step_robot(self.settings, self.site, self.time, self.received, robot)
        self.site = step.site
        if self._recorder:
            self._recorder.record(self.received, robot, step)
        self.endpoint, datagrams = send_from_robot(self.endpoint, step.outgoing)
        for peer, datagram in (*replies, *datagrams):
            if peer in self.operators:
                link = self.operators[peer].backward
                link.send(time_ns, datagram, priority(Kind(datagram[KIND_BYTE])))
        return step
