//! Definitions of the types that are read and written: the public interfaces of ROS 2 (common_interfaces, geometry2) and of the two
//! packages of tag detections, fields and types only.

const TIME: &str = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
const HEADER: &str = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
const POINT: &str = "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n";
const VECTOR: &str = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
const QUATERNION: &str =
    "MSG: geometry_msgs/Quaternion\nfloat64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n";
const POSE: &str = "MSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n";
const POSE_WITH_COVARIANCE: &str =
    "MSG: geometry_msgs/PoseWithCovariance\nPose pose\nfloat64[36] covariance\n";
const TRANSFORM: &str = "MSG: geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n";
const TRANSFORM_STAMPED: &str = "MSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\nTransform transform\n";
const STATUS: &str = "MSG: diagnostic_msgs/DiagnosticStatus\nbyte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\n\
    string name\nstring message\nstring hardware_id\nKeyValue[] values\n";
const KEY_VALUE: &str = "MSG: diagnostic_msgs/KeyValue\nstring key\nstring value\n";
const REGION: &str = "MSG: sensor_msgs/RegionOfInterest\nuint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n";
const TAG: &str = "MSG: apriltag_msgs/AprilTagDetection\nstring family\nint32 id\nint32 hamming\nfloat32 goodness\n\
    float32 decision_margin\nPoint centre\nPoint[4] corners\nfloat64[9] homography\n";
const TAG_POINT: &str = "MSG: apriltag_msgs/Point\nfloat64 x\nfloat64 y\n";
const ISAAC_TAG: &str = "MSG: isaac_ros_apriltag_interfaces/AprilTagDetection\nstring family\nint32 id\n\
    geometry_msgs/Point center\ngeometry_msgs/Point[4] corners\ngeometry_msgs/PoseWithCovarianceStamped pose\n";
const POSE_STAMPED: &str =
    "MSG: geometry_msgs/PoseWithCovarianceStamped\nstd_msgs/Header header\nPoseWithCovariance pose\n";

/// Type, its own fields, and what they are made of.
const KNOWN: &[(&str, &str, &[&str])] = &[
    (
        "sensor_msgs/Image",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n",
        &[HEADER, TIME],
    ),
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n", &[HEADER, TIME]),
    (
        "sensor_msgs/CameraInfo",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\nfloat64[9] r\n\
            float64[12] p\nuint32 binning_x\nuint32 binning_y\nRegionOfInterest roi\n",
        &[REGION, HEADER, TIME],
    ),
    (
        "apriltag_msgs/AprilTagDetectionArray",
        "std_msgs/Header header\nAprilTagDetection[] detections\n",
        &[TAG, TAG_POINT, HEADER, TIME],
    ),
    (
        "isaac_ros_apriltag_interfaces/AprilTagDetectionArray",
        "std_msgs/Header header\nAprilTagDetection[] detections\n",
        &[ISAAC_TAG, POSE_STAMPED, POSE_WITH_COVARIANCE, POSE, POINT, QUATERNION, HEADER, TIME],
    ),
    (
        "tf2_msgs/TFMessage",
        "geometry_msgs/TransformStamped[] transforms\n",
        &[TRANSFORM_STAMPED, TRANSFORM, VECTOR, QUATERNION, HEADER, TIME],
    ),
    (
        "geometry_msgs/PoseWithCovarianceStamped",
        "std_msgs/Header header\nPoseWithCovariance pose\n",
        &[POSE_WITH_COVARIANCE, POSE, POINT, QUATERNION, HEADER, TIME],
    ),
    (
        "diagnostic_msgs/DiagnosticArray",
        "std_msgs/Header header\nDiagnosticStatus[] status\n",
        &[STATUS, KEY_VALUE, HEADER, TIME],
    ),
];

/// Returns the definition of a type as `ros2msg`; `None` for types that are neither read nor written here.
pub(super) fn definition(name: &str) -> Option<String> {
    let name = name.replace("/msg/", "/");
    let (_, fields, parts) = KNOWN.iter().find(|(known, ..)| *known == name)?;
    let line = "=".repeat(80);
    let parts: String = parts.iter().map(|part| format!("{line}\n{part}")).collect();
    Some(format!("{fields}{parts}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::definition::{Definition, Kind};

    /// Whatever a definition is made of is in it.
    #[test]
    fn every_definition_is_complete() {
        for (name, ..) in KNOWN {
            let read = Definition::parse(name, &definition(name).unwrap()).unwrap();
            let mut waiting = vec![read.root.clone()];
            while let Some(message) = waiting.pop() {
                let fields = read.fields(&message).unwrap_or_else(|| panic!("{name} lacks {message}"));
                waiting.extend(fields.iter().filter_map(|field| match &field.kind {
                    Kind::Message(part) => Some(part.clone()),
                    _ => None,
                }));
            }
        }
    }
}
