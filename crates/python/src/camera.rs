//! `resight.Camera`.

use crate::arrays::{Numbers, array};
use crate::pixels::Pixels;
use crate::run::here;
use crate::{error, notebook};
use numpy::{PyArray, PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use resight::core::camera::ImageSize;
use resight::core::{CameraMatrix, Pixel, Point};
use resight::formats::{self, NamedCamera};
use resight::image::undistorted;
use resight::locate::IntrinsicsCovariance;
use resight::nominal::NominalLens;
use std::path::{Path, PathBuf};

/// A lens with its image size, and how well both are known.
#[pyclass(frozen, module = "resight")]
pub struct Camera {
    pub known: NamedCamera,
    /// What every answer that uses it says.
    pub remark: Option<String>,
    /// A camera with nominal intrinsics.
    is_nominal: bool,
}

impl Camera {
    /// As its file states it, with what is unusual there.
    fn of_file(known: NamedCamera, remarks: &[String]) -> Self {
        let remark = (!remarks.is_empty()).then(|| remarks.join("; "));
        Camera { known, remark, is_nominal: false }
    }
}

#[pymethods]
impl Camera {
    /// From the keys of camera.toml.
    #[new]
    #[pyo3(signature = (model, **keys))]
    fn new(py: Python<'_>, model: &str, keys: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let text = py.import("resight._make")?.call_method("camera_text", (model,), keys)?;
        Self::parse(py, text.extract()?)
    }

    /// From OpenCV's camera matrix and distortion coefficients.
    #[staticmethod]
    #[pyo3(signature = (matrix, distortion=None, *, image_size_px=None, fisheye=false))]
    fn from_matrix(
        py: Python<'_>,
        matrix: &Bound<'_, PyAny>,
        distortion: Option<&Bound<'_, PyAny>>,
        image_size_px: Option<(u32, u32)>,
        fisheye: bool,
    ) -> PyResult<Self> {
        let make = py.import("resight._make")?;
        let text = make.call_method1("matrix_text", (matrix, distortion, image_size_px, fisheye))?;
        Self::parse(py, text.extract()?)
    }

    /// From the text of a camera file of any format that `read` takes.
    #[staticmethod]
    fn parse(py: Python<'_>, text: &str) -> PyResult<Self> {
        let bytes = text.as_bytes().to_vec();
        let file = formats::read_cameras_from_bytes(Path::new("camera"), bytes);
        let file = file.map_err(|reason| error::file(py, &reason))?;
        let [known] = <[NamedCamera; 1]>::try_from(file.cameras)
            .map_err(|all| error::input(py, format!("one camera is needed, the text holds {}", all.len())))?;
        Ok(Camera::of_file(known, &file.warnings))
    }

    /// The camera of a file in any supported format; `FILE#NAME` picks one of several.
    #[staticmethod]
    fn read(py: Python<'_>, file: PathBuf) -> PyResult<Self> {
        let (known, remarks) =
            formats::read_camera_with_remarks(&file).map_err(|reason| error::file(py, &reason))?;
        Ok(Camera::of_file(known, &remarks))
    }

    /// All cameras of a file, by name.
    #[staticmethod]
    fn read_all<'py>(py: Python<'py>, file: PathBuf) -> PyResult<Bound<'py, PyDict>> {
        let found = formats::read_cameras(&file).map_err(|reason| error::file(py, &reason))?;
        let by_name = PyDict::new(py);
        for known in found.cameras {
            by_name.set_item(known.name.clone(), Camera::of_file(known, &found.warnings))?;
        }
        Ok(by_name)
    }

    /// A camera that nobody calibrated, with the standard deviations that such figures have.
    #[staticmethod]
    #[pyo3(signature = (*, image_size_px, hfov_deg=None, focal_mm=None, sensor_width_mm=None))]
    fn nominal(
        py: Python<'_>,
        image_size_px: (u32, u32),
        hfov_deg: Option<f64>,
        focal_mm: Option<f64>,
        sensor_width_mm: Option<f64>,
    ) -> PyResult<Self> {
        let lens = match (hfov_deg, focal_mm, sensor_width_mm) {
            (Some(hfov_deg), None, None) => NominalLens::HorizontalFieldOfView(hfov_deg),
            (None, Some(focal_mm), Some(sensor_width_mm)) => {
                NominalLens::FocalLength { focal_mm, sensor_width_mm }
            }
            _ => return Err(error::input(py, "give hfov_deg, or focal_mm and sensor_width_mm")),
        };
        let (width_px, height_px) = image_size_px;
        if width_px == 0 || height_px == 0 {
            let message = format!("image_size_px: {width_px} x {height_px} px is no size of an image");
            return Err(error::input(py, message));
        }
        let known =
            lens.camera(ImageSize { width_px, height_px }).map_err(|reason| error::job(py, &reason))?;
        Ok(Camera { known, remark: Some(lens.remark()), is_nominal: true })
    }

    /// As its file calls it.
    #[getter]
    fn name(&self) -> &str {
        &self.known.name
    }

    /// `pinhole`, `brown_conrady`, `kannala_brandt`, …
    #[getter]
    fn model(&self) -> &'static str {
        self.known.camera.model_name()
    }

    /// Width and height; None where the file states none.
    #[getter]
    fn image_size_px(&self) -> Option<(u32, u32)> {
        self.known.camera.size.map(|size| (size.width_px, size.height_px))
    }

    /// That it is not calibrated, say.
    #[getter]
    fn remark(&self) -> Option<&str> {
        self.remark.as_deref()
    }

    /// Intrinsic parameters by name, with the unit in the name; the order is that of `intrinsics_covariance`.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let parameters = PyDict::new(py);
        for (name, value) in self.known.camera.parameters() {
            parameters.set_item(name, value)?;
        }
        Ok(parameters)
    }

    /// OpenCV's `distCoeffs` (n,): the coefficients alone, in its order, none of a pinhole; None for a lens model that has no such list.
    #[getter]
    fn distortion<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<f64>>>> {
        let Some(d) = self.known.camera.distortion() else { return Ok(None) };
        array(py, d.to_vec(), &[d.len()]).map(Some)
    }

    /// OpenCV's camera matrix (3, 3), px; None for the photogrammetric model.
    #[getter]
    fn matrix<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<f64>>>> {
        let Some(k) = self.known.camera.matrix() else { return Ok(None) };
        array(py, vec![k.fx_px, 0.0, k.cx_px, 0.0, k.fy_px, k.cy_px, 0.0, 0.0, 1.0], &[3, 3]).map(Some)
    }

    /// Covariance of `parameters`, (n, n); None where they are taken as exact.
    #[getter]
    fn intrinsics_covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<f64>>>> {
        let Some(rows) = self.known.intrinsics_rows() else { return Ok(None) };
        let n = self.known.camera.parameters().len();
        array(py, rows, &[n, n]).map(Some)
    }

    /// Pixels (n, 2) of points (n, 3) given in the camera frame, metres.
    fn project<'py>(
        &self,
        py: Python<'py>,
        points_in_cam_m: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = Numbers::new("points_in_cam_m", points_in_cam_m)?;
        let rows = points.rows::<3>("points_in_cam_m")?;
        let mut pixels = Vec::with_capacity(2 * rows.len());
        for (i, [x, y, z]) in rows.iter().enumerate() {
            let pixel = self.known.camera.project(&Point::new(*x, *y, *z)).ok_or_else(|| {
                let message =
                    format!("point {i} ({x}, {y}, {z}) is outside the field of the camera; ask `sees` first");
                error::error(py, "outside_field", message)
            })?;
            pixels.extend([pixel.x, pixel.y]);
        }
        array(py, pixels, &[rows.len(), 2])
    }

    /// Which of the points (n, 3) in the camera frame have a pixel.
    fn sees<'py>(&self, points_in_cam_m: &Bound<'py, PyAny>) -> PyResult<Vec<bool>> {
        let points = Numbers::new("points_in_cam_m", points_in_cam_m)?;
        let rows = points.rows::<3>("points_in_cam_m")?;
        let sees = |[x, y, z]: &[f64; 3]| self.known.camera.project(&Point::new(*x, *y, *z)).is_some();
        Ok(rows.iter().map(sees).collect())
    }

    /// Unit vectors (n, 3) in the camera frame towards what is seen at pixels (n, 2).
    fn bearings<'py>(
        &self,
        py: Python<'py>,
        pixels: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let pixels = Numbers::new("pixels", pixels)?;
        let rows = pixels.rows::<2>("pixels")?;
        let mut bearings = Vec::with_capacity(3 * rows.len());
        for [u, v] in rows {
            let bearing = self.known.camera.bearing(&Pixel::new(*u, *v));
            bearings.extend(bearing.map_err(|reason| error::math(py, &reason))?.iter());
        }
        array(py, bearings, &[rows.len(), 3])
    }

    /// An image (height, width) or (height, width, channels) of uint8 as a pinhole would have taken it.
    #[pyo3(signature = (image, matrix=None))]
    fn undistort<'py>(
        &self,
        py: Python<'py>,
        image: &Bound<'py, PyAny>,
        matrix: Option<[[f64; 3]; 3]>,
    ) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        let pixels = Pixels::new(image)?;
        let matrix = match matrix {
            Some([[fx_px, 0.0, cx_px], [0.0, fy_px, cy_px], [0.0, 0.0, 1.0]])
                if [fx_px, fy_px].iter().all(|f| *f > 0.0 && f.is_finite())
                    && [cx_px, cy_px].iter().all(|c| c.is_finite()) =>
            {
                CameraMatrix { fx_px, fy_px, cx_px, cy_px }
            }
            Some(_) => {
                return Err(error::input(py, "matrix: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] is needed"));
            }
            None => self.known.camera.matrix().ok_or_else(|| {
                error::input(py, "matrix: this lens has none of its own; give that of the image wanted")
            })?,
        };
        let lens = &self.known.camera;
        let straight = here(py, || undistorted(&pixels.channels(), lens, &matrix))?;
        PyArray::from_vec(py, straight).reshape(pixels.shape)
    }

    /// The camera as a camera.toml.
    fn to_toml(&self, py: Python<'_>) -> PyResult<String> {
        formats::own_file(std::slice::from_ref(&self.known))
            .map_err(|reason| error::error(py, "write", reason.to_string()))
    }

    /// How `pickle` and `copy` make it again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let class = py.get_type::<Camera>();
        match self.is_nominal {
            false => Ok((class.getattr("parse")?, (self.to_toml(py)?,))),
            true => Err(error::input(py, "a nominal camera is not pickled; construct it where it is needed")),
        }
    }

    /// What a notebook shows: model, image size, and each parameter with its standard deviation where that is stated.
    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        let Camera { known, .. } = self;
        let mut rows = vec![("name", known.name.clone()), ("model", known.camera.model_name().to_owned())];
        if let Some(size) = known.camera.size {
            rows.push(("image", format!("{} x {} px", size.width_px, size.height_px)));
        }
        let parameters = known.camera.parameters();
        for (i, (name, value)) in parameters.iter().enumerate() {
            let sigma = known.intrinsics_covariance.as_ref().map(|c| c[(i, i)].max(0.0).sqrt());
            let sigma = sigma.map(|sigma| format!(" ± {sigma:.2e}")).unwrap_or_default();
            rows.push((name, format!("{value}{sigma}")));
        }
        notebook::named(py, rows)
    }

    fn __repr__(&self) -> String {
        let size = self.known.camera.size.map(|s| format!(", {} x {} px", s.width_px, s.height_px));
        let sigma = self.known.intrinsics_covariance.as_ref().map(|c| c[(0, 0)].max(0.0).sqrt());
        let focal = self.known.camera.matrix().map(|k| match sigma {
            Some(sigma) => format!(", fx {:.2} ± {sigma:.2} px", k.fx_px),
            None => format!(", fx {:.2} px", k.fx_px),
        });
        let Camera { known, .. } = self;
        format!(
            "Camera({:?}, {}{}{})",
            known.name,
            known.camera.model_name(),
            size.unwrap_or_default(),
            focal.unwrap_or_default()
        )
    }
}

impl Camera {
    /// How well the intrinsics are known; none: exactly.
    pub fn intrinsics(&self) -> Option<IntrinsicsCovariance> {
        IntrinsicsCovariance::of(&self.known)
    }
}
