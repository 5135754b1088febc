//! A session as one file: a scene that `resight measure` reads, with the table `[session]` that holds the session itself.

use crate::places::Places;
use crate::refusal::{Refusal, Step};
use crate::session::Session;
use crate::state::{PhotoState, State};
use crate::texts;
use crate::{GivenLens, MeasuredKind};
use crate::{edit, lens, network};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use resight::formats::{self, NamedCamera};
use resight::image::DecodingBytes;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use toml::{Table, Value};

/// The file as the page reads it; the scene beside it is `resight measure`'s.
#[derive(Serialize, Deserialize)]
struct Saved {
    session: State,
}

impl Session {
    /// The session as TOML, photographs included.
    ///
    /// # Errors
    /// A number that TOML does not hold.
    pub fn save(&self) -> Result<String, Refusal> {
        self.saved(&self.state)
    }

    /// Saves the session with the hashes of the photographs instead of their files, for a page that has the files itself.
    ///
    /// # Errors
    /// The errors of [`Session::save`].
    pub fn save_without_photographs(&self) -> Result<String, Refusal> {
        let bare = |p: &PhotoState| PhotoState { photograph: Arc::new(p.photograph.bare()), ..p.clone() };
        self.saved(&State { photos: self.state.photos.iter().map(bare).collect(), ..self.state.clone() })
    }

    fn saved(&self, state: &State) -> Result<String, Refusal> {
        let places = &*self.places;
        let solved: Vec<_> = (0..self.state.photos.len()).map(|i| self.solved(i)).collect();
        let failed = |reason: toml::ser::Error| Refusal { step: Step::Photograph, text: reason.to_string() };
        let mut file = scene(&self.state, places, &solved);
        let own = toml::to_string(&Saved { session: state.clone() }).map_err(failed)?;
        let head = "# A session of `resight serve`. `resight measure` reads it too: it leaves the table [session] alone.\n";
        file.insert("sigma_px".into(), self.state.sigma_px.into());
        let scene = toml::to_string(&file).map_err(failed)?;
        Ok(format!("{head}{scene}\n{own}"))
    }

    /// A session that was saved.
    ///
    /// # Errors
    /// The errors of [`SavedSession::read`] and [`SavedSession::open`].
    pub fn load(text: &str) -> Result<Self, Refusal> {
        SavedSession::read(text)?.open()
    }
}

/// A saved session whose photographs are not decoded yet.
#[derive(Debug)]
pub struct SavedSession {
    own: Value,
}

fn fault(text: impl Into<String>) -> Refusal {
    Refusal { step: Step::Photograph, text: text.into() }
}

impl SavedSession {
    /// Reads the file.
    ///
    /// # Errors
    /// A sentence: no TOML, no session, more or larger photographs than a session holds.
    pub fn read(text: &str) -> Result<Self, Refusal> {
        let mut table: Table = toml::from_str(text).map_err(|e| fault(e.message()))?;
        let own = table.remove("session").ok_or_else(|| fault(texts::NOTHING_SAVED))?;
        let saved = SavedSession { own };
        let n_photos = saved.own.get("photos").and_then(Value::as_array).map_or(0, Vec::len);
        // Four letters hold three bytes.
        edit::check_photographs(n_photos, saved.encoded().map(|text| text.len() / 4 * 3).sum())?;
        Ok(saved)
    }

    /// Returns the photographs' files in base64.
    fn encoded(&self) -> impl Iterator<Item = &str> {
        let photos = self.own.get("photos").and_then(Value::as_array).into_iter().flatten();
        photos.filter_map(|p| p.get("photograph")?.get("image_base64")?.as_str())
    }

    /// Returns the memory that the decoded photographs take, with what decoding the largest takes besides, bytes.
    pub fn decoding_bytes(&self) -> usize {
        let of = |text: &str| DecodingBytes::of(&STANDARD.decode(text).ok()?);
        let all: Vec<DecodingBytes> = self.encoded().filter_map(of).collect();
        let images = all.iter().fold(0, |sum: u64, one| sum.saturating_add(one.image));
        let besides = all.iter().map(|one| one.besides).max().unwrap_or(0);
        usize::try_from(images.saturating_add(besides)).unwrap_or(usize::MAX)
    }

    /// Decodes the photographs and solves.
    ///
    /// # Errors
    /// A sentence: a photograph that is torn, keys that nothing has, more than a session holds.
    pub fn open(self) -> Result<Session, Refusal> {
        let state: State = self.own.try_into().map_err(|e: toml::de::Error| fault(e.message()))?;
        edit::check(&state)?;
        Ok(Session::of(state))
    }
}

fn table<const N: usize>(entries: [(&str, Value); N]) -> Value {
    Value::Table(entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect())
}

/// The scene of `resight measure`.
fn scene(state: &State, places: &Places, solved: &[Option<Arc<crate::pose::Solved>>]) -> Table {
    let mut file = Table::new();
    let control_point = |(name, place): (&String, &crate::places::Place)| {
        let [x, y, z]: [f64; 3] = place.x_m.into();
        table([
            ("name", name.clone().into()),
            ("x_m", x.into()),
            ("y_m", y.into()),
            ("z_m", z.into()),
            ("sigma_m", place.sigma_m.into()),
        ])
    };
    let mut on_plane: Vec<Value> = Vec::new();
    let (mut queries, mut uprights) = (Vec::new(), Vec::new());
    for m in &state.measurements {
        let name = |i: usize| format!("{} · {}", m.name, i + 1);
        let names: Vec<Value> = (0..m.points.len()).map(|i| name(i).into()).collect();
        let (kind, asked) = match m.what {
            MeasuredKind::Height => {
                uprights.push(table([("foot", name(0).into()), ("top", name(1).into())]));
                on_plane.push(names[0].clone());
                ("height", vec![names[1].clone()])
            }
            MeasuredKind::Length => ("distance", names),
            MeasuredKind::Polyline => ("polyline", names),
            MeasuredKind::Area => ("area", names),
            MeasuredKind::Position => ("position", names),
        };
        if m.what != MeasuredKind::Height {
            on_plane.extend(asked.iter().cloned());
        }
        queries.push(table([
            ("kind", kind.into()),
            ("points", asked.into()),
            ("name", m.name.clone().into()),
        ]));
    }
    file.insert("control_point".into(), places.by_name.iter().map(control_point).collect::<Vec<_>>().into());
    file.insert(
        "plane".into(),
        table([
            ("points", on_plane.into()),
            ("z_m", 0.0.into()),
            ("sigma_m", network::flatness_m(places).into()),
        ]),
    );
    file.insert("upright".into(), uprights.into());
    file.insert("query".into(), queries.into());
    let photos = state.photos.iter().enumerate().filter_map(|(i, p)| photo(state, i, p, solved));
    file.insert("photo".into(), photos.collect::<Vec<_>>().into());
    file
}

fn photo(
    state: &State,
    number: usize,
    photo: &PhotoState,
    solved: &[Option<Arc<crate::pose::Solved>>],
) -> Option<Value> {
    let lender = lens::lender(state, number).and_then(Result::ok).unwrap_or(number);
    let camera_text = camera_text(state.photos.get(lender)?, solved.get(lender)?.as_deref())?;
    let clicked = photo.points.iter().map(|p| (p.name.clone(), [p.u_px, p.v_px], p.sigma_px));
    let measured = state.measurements.iter().filter(|m| m.photo == number).flat_map(|m| {
        m.points.iter().enumerate().map(|(i, at)| (format!("{} · {}", m.name, i + 1), *at, None))
    });
    let points = clicked.chain(measured).map(|(name, [u, v], sigma_px)| {
        let sigma_px = sigma_px.unwrap_or(state.sigma_px);
        table([("point", name.into()), ("u_px", u.into()), ("v_px", v.into()), ("sigma_px", sigma_px.into())])
    });
    Some(table([
        ("name", photo.photograph.name.clone().into()),
        ("camera", "camera".into()),
        ("camera_text", camera_text.into()),
        ("image_points", points.collect::<Vec<_>>().into()),
    ]))
}

/// The lens as a camera file of our own: as given, or as estimated.
fn camera_text(photo: &PhotoState, solved: Option<&crate::pose::Solved>) -> Option<String> {
    if let (Some(GivenLens::File { text, name }), false) = (&photo.lens, name_picks_one(photo)) {
        let read = formats::read_cameras_from_bytes(name, text.clone().into_bytes()).ok()?;
        if read.cameras.len() == 1 {
            return formats::own_file(&read.cameras).ok();
        }
    }
    let (camera, rows) = match (solved, lens::known(photo.lens.as_ref()?, &photo.photograph).ok()?) {
        (Some(solved), _) => (solved.camera.clone(), solved.intrinsics_covariance.clone()),
        (None, lens::KnownLens::Camera { camera, intrinsics, .. }) => {
            let rows = intrinsics.map(|known| known.covariance(&camera));
            (*camera, rows)
        }
        (None, lens::KnownLens::Unknown(_)) => return None,
    };
    let n = camera.parameters().len();
    let intrinsics_covariance =
        rows.filter(|r| r.len() == n * n).map(|r| nalgebra::DMatrix::from_row_slice(n, n, &r));
    let named = NamedCamera { name: "camera".to_owned(), camera, placement: None, intrinsics_covariance };
    formats::own_file(&[named]).ok()
}

fn name_picks_one(photo: &PhotoState) -> bool {
    matches!(&photo.lens, Some(GivenLens::File { name, .. }) if name.contains('#'))
}
