"""The fleet agent at a real broker with its own certificate: it answers, says farewell, and leaves its last will."""

from __future__ import annotations

import json
import signal
from contextlib import closing
from pathlib import Path
from typing import Any

from tests.support.fleet.broker import Peer, running_broker
from tests.support.processes import Start
from tests.support.waiting import wait_for

PREFIX = "uagv/v2/robot_stack/robot_1"


def test_agent_answers_and_its_end_is_announced(start: Start, tmp_path: Path) -> None:
    with running_broker(tmp_path / "site") as broker:
        files = broker.site.add_robot("robot_1")
        settings = {
            "url": broker.site.robot_url(),
            "ca_file": files.ca,
            "certificate_file": files.certificate,
            "key_file": files.key,
        }
        arguments = [part for name, value in settings.items() for part in ("-p", f"broker.{name}:={value}")]
        with closing(Peer(broker.params(broker.site.master()), "manager").connected().subscribe()) as master:

            def last(topic: str) -> dict[str, Any]:
                payloads = master.payloads(f"{PREFIX}/{topic}")
                return json.loads(payloads[-1]) if payloads else {}

            agent = start("fleet_agent", *arguments)
            wait_for(lambda: last("connection").get("connectionState") == "ONLINE", "online")
            wait_for(lambda: last("factsheet"), "factsheet")
            request = {"actionType": "stateRequest", "actionId": "r-1", "blockingType": "NONE"}
            header = {key: last("factsheet")[key] for key in ("version", "manufacturer", "serialNumber", "timestamp")}
            master.publish(f"{PREFIX}/instantActions", json.dumps({**header, "headerId": 1, "actions": [request]}))
            wait_for(
                lambda: [
                    action
                    for action in last("state").get("actionStates", [])
                    if (action["actionId"], action["actionStatus"]) == ("r-1", "FINISHED")
                ],
                "the answered request",
            )
            agent.signal(signal.SIGINT)
            wait_for(lambda: last("connection")["connectionState"] == "OFFLINE", "farewell")
            agent.wait()
            again = start("fleet_agent", *arguments)
            wait_for(lambda: last("connection")["connectionState"] == "ONLINE", "online again")
            again.signal(signal.SIGKILL)
            wait_for(lambda: last("connection")["connectionState"] == "CONNECTIONBROKEN", "last will")
