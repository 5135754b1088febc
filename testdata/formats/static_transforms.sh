#!/bin/sh
# static_transform_publisher x y z qx qy qz qw parent child
ros2 run tf2_ros static_transform_publisher --x 0.1 --y 0.06 --z 1.2 \
  --roll -1.5707963267948966 --yaw -1.5707963267948966 \
  --frame-id base_link --child-frame-id left_optical_frame &
ros2 run tf2_ros static_transform_publisher 0.1 -0.06 1.2 -0.5 0.5 -0.5 0.5 base_link right_optical_frame
