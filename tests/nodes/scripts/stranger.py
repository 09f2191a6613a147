"""A foreign participant with the robot's address that tries to press the emergency stop, drive the robot and reset it.

Arguments: the robot's address, and the time limit in seconds. Ends as soon as all three endpoints are found.
"""

import os
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

address, seconds = sys.argv[1], float(sys.argv[2])
PEER = f"<locator><udpv4><address>{address}</address></udpv4></locator>"
PROFILE = f"""<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <transport_descriptors><transport_descriptor>
    <transport_id>udp</transport_id><type>UDPv4</type><maxInitialPeersRange>40</maxInitialPeersRange>
  </transport_descriptor></transport_descriptors>
  <participant profile_name="stranger" is_default_profile="true"><rtps>
    <builtin><initialPeersList>{PEER}</initialPeersList></builtin>
    <useBuiltinTransports>false</useBuiltinTransports>
    <userTransports><transport_id>udp</transport_id></userTransports>
  </rtps></participant>
</profiles>"""

with TemporaryDirectory() as folder:
    path = Path(folder) / "stranger.xml"
    path.write_text(PROFILE, encoding="ascii")
    os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(path)
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SYSTEM_DEFAULT"
    os.environ["ROS_LOG_DIR"] = folder

    import rclpy
    from geometry_msgs.msg import Twist
    from std_msgs.msg import Bool
    from std_srvs.srv import Trigger

    from robot_stack.contract import services, topics
    from robot_stack.ros.interfaces import qos_profile

    rclpy.init()
    node = rclpy.create_node("stranger")
    stop = node.create_publisher(Bool, topics.EMERGENCY_STOP.name, qos_profile(topics.EMERGENCY_STOP.qos))
    drive = node.create_publisher(Twist, topics.CMD_VEL.name, qos_profile(topics.CMD_VEL.qos))
    reset = node.create_client(Trigger, services.SAFETY_RESET.name)
    end_s = time.monotonic() + seconds
    received = (0, 0, 0)
    while time.monotonic() < end_s and not all(received):
        stop.publish(Bool(data=True))
        drive.publish(Twist())
        rclpy.spin_once(node, timeout_sec=0.1)
        received = (stop.get_subscription_count(), drive.get_subscription_count(), int(reset.service_is_ready()))
    print("discovered by", *received)
