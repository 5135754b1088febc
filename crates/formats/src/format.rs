//! The names of the formats; what each reads and writes is in `table`.

/// The file formats Resight knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Our own camera file (TOML), one camera or several with poses.
    Own,
    /// OpenCV FileStorage, YAML, XML or JSON.
    OpenCv,
    /// ROS `sensor_msgs/CameraInfo`, as `camera_calibration` saves it or `ros2 topic echo` prints it.
    RosCameraInfo,
    /// An MCAP recording with camera_info topics, only read.
    Mcap,
    /// Kalibr camera chain.
    Kalibr,
    /// EuRoC / ASL `sensor.yaml`.
    Euroc,
    /// COLMAP text model: `cameras.txt`, `images.txt`, `rigs.txt`, `frames.txt`.
    Colmap,
    /// mrcal `.cameramodel`.
    Mrcal,
    /// PhotonVision or Limelight calibration JSON.
    PhotonVision,
    /// Kalibr's text report, `results-cam.txt`; read only.
    KalibrReport,
    /// Basalt calibration JSON.
    Basalt,
    /// Caliscope `camera_array.toml`.
    Caliscope,
    /// aniposelib `calibration.toml`.
    Aniposelib,
    /// multical `calibration.json`.
    Multical,
    /// MC-Calib `calibrated_cameras_data.yml`.
    McCalib,
    /// PhotonVision before 2024 and Limelight, written; `PhotonVision` reads both shapes.
    PhotonVisionOld,
    /// easy_handeye's YAML, the camera on the robot's base when written; both are read as this.
    EasyHandeyeOnBase,
    /// The same with the camera on the robot's hand.
    EasyHandeyeOnHand,
    /// fSpy's camera parameters, written only.
    FSpy,
    /// A Python script for Blender, written only.
    Blender,
    /// glTF 2.0, written only.
    Gltf,
    /// ROS static transforms: launch files, scripts, lists. Written as a Python launch file.
    StaticTransforms,
    /// The same as a YAML list; recognised as `StaticTransforms`.
    StaticTransformsYaml,
    /// URDF, fixed joints.
    Urdf,
    /// KITTI `calib.txt` and the raw data's files. Written as the object benchmark has it.
    Kitti,
    /// KITTI odometry's `calib.txt`; recognised as `Kitti`.
    KittiOdometry,
    /// A key for each number: `fx`, `fy`, `cx`, `cy`, `k1` …; read only.
    PlainKeys,
    /// ORB-SLAM2 and 3, `Camera.fx` …; read only.
    OrbSlam,
    /// camodocal's YAML, as VINS has it; read only.
    Camodocal,
    /// `transforms.json` of nerfstudio and instant-ngp.
    NerfTransforms,
    /// OpenSfM's `camera_models.json` and `reconstruction.json`; read only.
    OpenSfm,
    /// Luxonis OAK calibration, as DepthAI stores it; read only.
    DepthAi,
    /// Azure Kinect factory calibration; read only.
    AzureKinect,
    /// librealsense's intrinsics as JSON; read only.
    RealSense,
    /// Stereolabs ZED factory calibration; read only.
    Zed,
    /// KWIVER's `.krtd`; read only.
    Krtd,
    /// Autoware's sensor calibration, poses only; read only.
    Autoware,
    /// Matrices under keys `b_from_a`, poses only; read only.
    PoseMatrices,
    /// Cameras of MATLAB, exported or displayed; read only.
    Matlab,
    /// Argoverse 1 and 2; read only.
    Argoverse,
    /// Oxford RobotCar's models and extrinsics; read only.
    RobotCar,
    /// Lens profile of Gyroflow; read only.
    Gyroflow,
    /// Lens database of lensfun; read only.
    Lensfun,
    /// Agisoft Metashape's exported cameras or calibration (XML); read only.
    Metashape,
    /// nuScenes `calibrated_sensor.json`, with `sensor.json` where it lies beside.
    NuScenes,
    /// OpenCV FileStorage as XML; recognised as `OpenCv`.
    OpenCvXml,
    /// Our own target file (TOML).
    OwnTarget,
    /// Kalibr target YAML, or Basalt's JSON duplicate.
    KalibrTarget,
    /// WPILib field layout JSON.
    WpilibLayout,
    /// Caliscope `charuco.toml`.
    CaliscopeCharuco,
}

impl Format {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Format::Own => "Resight camera file (TOML)",
            Format::OpenCv => "OpenCV FileStorage",
            Format::RosCameraInfo => "ROS camera_info",
            Format::Mcap => "MCAP recording",
            Format::Kalibr => "Kalibr camera chain",
            Format::KalibrReport => "Kalibr report (results-cam.txt)",
            Format::Euroc => "EuRoC sensor.yaml",
            Format::Colmap => "COLMAP text model",
            Format::Mrcal => "mrcal .cameramodel",
            Format::PhotonVision => "PhotonVision / Limelight calibration",
            Format::Basalt => "Basalt calibration",
            Format::Caliscope => "Caliscope camera array",
            Format::Aniposelib => "aniposelib camera group",
            Format::Multical => "multical calibration",
            Format::McCalib => "MC-Calib cameras",
            Format::PhotonVisionOld => "PhotonVision / Limelight calibration before 2024",
            Format::EasyHandeyeOnBase => "easy_handeye calibration",
            Format::EasyHandeyeOnHand => "easy_handeye calibration (camera on the hand)",
            Format::FSpy => "fSpy camera parameters",
            Format::Blender => "Blender script",
            Format::Gltf => "glTF scene",
            Format::StaticTransforms => "ROS static transforms",
            Format::StaticTransformsYaml => "ROS static transforms (YAML)",
            Format::Urdf => "URDF",
            Format::Kitti => "KITTI calibration",
            Format::KittiOdometry => "KITTI odometry calibration",
            Format::PlainKeys => "camera with a key for each number",
            Format::OrbSlam => "ORB-SLAM settings",
            Format::Camodocal => "camodocal (VINS) camera",
            Format::NerfTransforms => "transforms.json (nerfstudio, instant-ngp)",
            Format::OpenSfm => "OpenSfM cameras",
            Format::DepthAi => "DepthAI (OAK) calibration",
            Format::AzureKinect => "Azure Kinect calibration",
            Format::RealSense => "RealSense intrinsics",
            Format::Zed => "ZED calibration",
            Format::Krtd => "KWIVER camera (.krtd)",
            Format::Autoware => "Autoware sensor calibration",
            Format::PoseMatrices => "matrices named b_from_a",
            Format::Matlab => "MATLAB camera",
            Format::Argoverse => "Argoverse calibration",
            Format::RobotCar => "RobotCar calibration",
            Format::Gyroflow => "Gyroflow lens profile",
            Format::Lensfun => "lensfun lens database",
            Format::Metashape => "Metashape cameras (XML)",
            Format::NuScenes => "nuScenes calibrated_sensor",
            Format::OpenCvXml => "OpenCV FileStorage (XML)",
            Format::OwnTarget => "Resight target file (TOML)",
            Format::KalibrTarget => "Kalibr target",
            Format::WpilibLayout => "WPILib field layout",
            Format::CaliscopeCharuco => "Caliscope charuco board",
        }
    }
}
