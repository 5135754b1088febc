"""Cameras of the cart; static_transform_publisher publishes them."""
from launch import LaunchDescription
from launch_ros.actions import Node


def generate_launch_description():
    return LaunchDescription([
        Node(
            package='tf2_ros',
            executable='static_transform_publisher',
            name='left_tf',
            # x right, y down, z forward
            arguments=['--x', '0.1', '--y', '0.06', '--z', '1.2',
                       '--qx', '-0.5', '--qy', '0.5', '--qz', '-0.5', '--qw', '0.5',
                       '--frame-id', 'base_link', '--child-frame-id', 'left_optical_frame'],
        ),
        Node(package="tf2_ros", executable="static_transform_publisher",
             arguments=["0.1", "-0.06", "1.2", "-1.5707963267948966", "0", "-1.5707963267948966",
                        "base_link", "right_optical_frame"]),
    ])
