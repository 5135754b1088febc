# Poses of camera frames (optical: x right, y down, z forward) in their parent: x_parent = R x_child + t, metres.
from launch import LaunchDescription
from launch_ros.actions import Node


def generate_launch_description():
    return LaunchDescription([
        Node(
            package="tf2_ros",
            executable="static_transform_publisher",
            arguments=[
                "--x", "1.2", "--y", "0.3", "--z", "-0.1",
                "--qx", "0.5", "--qy", "-0.5", "--qz", "0.5", "--qw", "0.5",
                "--frame-id", "world", "--child-frame-id", "left_optical_frame",
            ],
        ),
        Node(
            package="tf2_ros",
            executable="static_transform_publisher",
            arguments=[
                "--x", "1.0818272690923632", "--y", "0.43076769292283085", "--z", "0.389344262295082",
                "--qx", "0.5998800359880041", "--qy", "-0.4799040287904034", "--qz", "0.4999000299900035", "--qw", "0.3999200239920029",
                "--frame-id", "world", "--child-frame-id", "right_optical_frame",
            ],
        ),
        Node(
            package="tf2_ros",
            executable="static_transform_publisher",
            arguments=[
                "--x", "-2.0", "--y", "0.5", "--z", "1.0",
                "--qx", "0.0", "--qy", "0.8000000000000002", "--qz", "0.0", "--qw", "0.6",
                "--frame-id", "world", "--child-frame-id", "tele_optical_frame",
            ],
        ),
    ])
