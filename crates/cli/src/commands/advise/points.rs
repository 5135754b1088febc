//! Marks measured so far: where should the next one go?

use super::read::{Place, places, poses};
use super::say::{Figures, say};
use super::{Advise, AimName};
use crate::output::Outcome;
use anyhow::{Context, Result, bail};
use resight::advise::maps::FurtherPoint;
use resight::core::advise::expect::{NEEDED_SEPARATION_SIGMA, View, expect};
use resight::core::advise::ground::{GroundLength, Plane};
use resight::core::advise::layout::concerns;
use resight::core::advise::point::{Aim, NextPoint, spread_out};
use resight::core::locate::{Config, locate};
use resight::core::target::KnownPoint;
use resight::core::{Camera, Correspondence, Pixel, Point, Pose};
use resight::report::verdict::Status;
use serde::Serialize;
use std::path::Path;

/// Cells along each side of a region.
const CELLS: usize = 60;
/// Places advised.
const ADVISED: usize = 5;

#[derive(Serialize)]
struct Now {
    kind: &'static str,
    n_points: usize,
    sigma_px: f64,
    #[serde(flatten)]
    figures: Figures,
}

#[derive(Serialize)]
struct Suggestion<'a> {
    kind: &'static str,
    rank: usize,
    id: &'a str,
    x_in_target_m: [f64; 3],
    #[serde(flatten)]
    figures: Figures,
}

/// What a question about points is made of.
struct Question<'a> {
    args: &'a Advise,
    camera: &'a Camera,
    cam_from_target: Pose,
    marks: Vec<KnownPoint>,
    names: Vec<String>,
    length: Option<GroundLength>,
    aim: (Aim, &'static str),
}

/// See `Advise`.
pub fn run(args: &Advise, camera: &Camera, file: &Path) -> Result<Outcome> {
    super::must_have_image(camera, &args.camera)?;
    let marks = places(file)?;
    let cam_from_target = pose(args, camera, &marks)?;
    let length = length(args, camera, &cam_from_target)?;
    let aim = aim(args, length)?;
    let names = marks.iter().map(|m| m.name.clone()).collect();
    let marks = marks.into_iter().map(|m| m.known).collect();
    Question { args, camera, cam_from_target, marks, names, length, aim }.answer()
}

/// The pose stated, or the one that the marks' pixels give.
fn pose(args: &Advise, camera: &Camera, marks: &[Place]) -> Result<Pose> {
    if let Some(path) = &args.pose {
        return poses(path, &["cam_from_target"])?.first().copied().context("no pose");
    }
    let one = |m: &Place| {
        let [u, v] = m.pixel.with_context(|| {
            format!(
                "mark {} has no u_px,v_px; fill them in, or give about where the camera is with --pose",
                m.name
            )
        })?;
        let c = Correspondence::new(camera, m.known.position, Pixel::new(u, v), args.sigma_px)?;
        Ok(Correspondence { sigma_m: m.known.sigma_m, ..c })
    };
    let seen: Vec<Correspondence> = marks.iter().map(one).collect::<Result<_>>()?;
    let answer = locate(&seen, camera, &Config::default()).context("the marks' pixels give no pose")?;
    let all: Vec<Pose> = answer.minima().filter(|h| h.is_rival).map(|h| h.minimum.cam_from_target).collect();
    // Of poses that fit alike, the one above the ground; the user can say otherwise.
    let above = |pose: &&Pose| args.ground_z_m < pose.origin().z;
    let taken = all.iter().find(above).copied().unwrap_or(answer.cam_from_target);
    if 1 < all.len() {
        let at = |p: &Pose| format!("({:.2}, {:.2}, {:.2}) m", p.origin().x, p.origin().y, p.origin().z);
        let list = all.iter().map(at).collect::<Vec<_>>().join(", ");
        args.remark(&format!(
            "{} poses fit these marks, camera at {list}; {} is taken, say otherwise with --pose",
            all.len(),
            at(&taken)
        ));
    }
    Ok(taken)
}

fn length(args: &Advise, camera: &Camera, pose: &Pose) -> Result<Option<GroundLength>> {
    let Some([a, b, c, d]) = args.length_m else { return Ok(None) };
    let ends = [Point::new(a, b, args.ground_z_m), Point::new(c, d, args.ground_z_m)];
    let length = Plane::level(args.ground_z_m).length(camera, pose, ends, args.sigma_px);
    length.map(Some).context("--length-m")
}

fn aim(args: &Advise, length: Option<GroundLength>) -> Result<(Aim, &'static str)> {
    match (args.minimise, length) {
        (Some(AimName::Length) | None, Some(length)) => Ok((Aim::Length(length), "length")),
        (Some(AimName::Length), None) => bail!("--minimise length needs --length-m X1,Y1,X2,Y2"),
        (Some(AimName::Rotation), _) => Ok((Aim::Rotation, "rotation")),
        (Some(AimName::Place) | None, _) => Ok((Aim::Place, "camera's place")),
    }
}

impl Question<'_> {
    fn view<'b>(&'b self, points: &'b [KnownPoint]) -> View<'b> {
        View {
            camera: self.camera,
            cam_from_target: self.cam_from_target,
            points,
            sigma_px: self.args.sigma_px,
        }
    }

    fn answer(&self) -> Result<Outcome> {
        let view = self.view(&self.marks);
        let next = NextPoint::new(view).context("the marks so far")?;
        let (candidates, names, region_m) = self.candidates()?;
        let ranked = next.ranked(&candidates, &self.aim.0);
        if ranked.is_empty() {
            bail!(
                "none of the {} places tried can be seen by the camera; check --pose, the region and --ground-z-m",
                candidates.len()
            );
        }
        self.say_now(&view)?;
        let is_grid = self.args.candidates.is_none();
        let diagonal = (region_m[2] - region_m[0]).hypot(region_m[3] - region_m[1]);
        let (apart_m, most) = if is_grid { (0.15 * diagonal, ADVISED) } else { (0.0, 20) };
        let best = spread_out(&candidates, &ranked, apart_m, most);
        let mut answered = false;
        for (rank, i) in best.iter().enumerate() {
            answered |= self.say_suggestion(rank + 1, &names[*i], &candidates[*i])?;
        }
        self.say_rest(&candidates, &ranked)?;
        let places: Vec<Point> = best.iter().map(|i| candidates[*i].position).collect();
        let with = next.with(&candidates[best[0]]).map(|gain| gain.covariance);
        self.pictures(&next, &places, region_m, with)?;
        Ok(Outcome::of([if answered { Status::Ok } else { Status::Degenerate }]))
    }

    fn say_now(&self, view: &View) -> Result<()> {
        let e = expect(view).context("the marks so far")?;
        let sigma_length = self.length.map(|l| l.sigma_m(&e.covariance));
        let figures = Figures::new(&e, sigma_length, &concerns(view, &e));
        let centre = self.cam_from_target.origin();
        let text = format!(
            "{} marks at σ {} px, camera at ({:.2}, {:.2}, {:.2}) m\n  now   {}\n{}\nthe next one, best first for the {}\n",
            self.marks.len(),
            self.args.sigma_px,
            centre.x,
            centre.y,
            centre.z,
            figures.words(),
            figures.warnings(),
            self.aim.1
        );
        say(
            self.args.json,
            &Now { kind: "now", n_points: self.marks.len(), sigma_px: self.args.sigma_px, figures },
            &text,
        )
    }

    /// True where its figures hold.
    fn say_suggestion(&self, rank: usize, name: &str, candidate: &KnownPoint) -> Result<bool> {
        let points = [self.marks.as_slice(), &[*candidate]].concat();
        let view = self.view(&points);
        let e = match expect(&view) {
            Ok(e) => e,
            Err(reason) => {
                self.args.remark(&format!("{name}: {reason}"));
                return Ok(false);
            }
        };
        let sigma_length = self.length.map(|l| l.sigma_m(&e.covariance));
        let figures = Figures::new(&e, sigma_length, &concerns(&view, &e));
        let x = candidate.position;
        let at = format!("{name:<6} x {:.2}  y {:.2}  z {:.2} m", x.x, x.y, x.z);
        let text = format!("  {rank}  {at:<36} {}\n{}", figures.words(), figures.warnings());
        let holds = figures.holds;
        let object = Suggestion { kind: "suggestion", rank, id: name, x_in_target_m: x.into(), figures };
        say(self.args.json, &object, &text)?;
        Ok(holds)
    }

    /// How much it matters: what the rest of the places would give.
    fn say_rest(
        &self,
        candidates: &[KnownPoint],
        ranked: &[(usize, resight::core::advise::point::Gain)],
    ) -> Result<()> {
        if self.args.json {
            return Ok(());
        }
        let clear: Vec<f64> = ranked
            .iter()
            .filter(|(_, g)| NEEDED_SEPARATION_SIGMA <= g.separation_sigma)
            .map(|(_, g)| self.aim.0.sigma(&g.covariance))
            .collect();
        let sigma = |x: f64| {
            if self.aim.0 == Aim::Rotation {
                resight::advise::words::sigma_rad(x)
            } else {
                resight::advise::words::sigma_m(x)
            }
        };
        let spread = match clear.as_slice() {
            [] => "none tells the poses apart".to_string(),
            all => format!(
                "{} from ± {} to ± {}, half below ± {}",
                self.aim.1,
                sigma(all[0]),
                sigma(all[all.len() - 1]),
                sigma(all[all.len() / 2])
            ),
        };
        let (tried, hidden, ambiguous) =
            (candidates.len(), candidates.len() - ranked.len(), ranked.len() - clear.len());
        crate::output::print(&format!(
            "\nof {tried} places tried: {spread}; {hidden} out of sight, {ambiguous} would leave the pose ambiguous\n"
        ))
    }

    /// Places to try, their names and the box they are in.
    fn candidates(&self) -> Result<(Vec<KnownPoint>, Vec<String>, [f64; 4])> {
        if let Some(path) = &self.args.candidates {
            let (known, names): (Vec<_>, Vec<_>) =
                places(path)?.into_iter().map(|p| (p.known, p.name)).unzip();
            let region =
                around(known.iter().map(|p| p.position).chain(self.marks.iter().map(|p| p.position)), 0.1);
            return Ok((known, names, region));
        }
        let ends = self
            .args
            .length_m
            .iter()
            .flat_map(|[a, b, c, d]| [Point::new(*a, *b, 0.0), Point::new(*c, *d, 0.0)]);
        let of_marks = self.marks.iter().map(|p| p.position);
        let region = self.args.region_m.unwrap_or_else(|| around(of_marks.chain(ends), 0.5));
        let [x0, y0, x1, y1] = region;
        let part = |i: usize| (i as f64 + 0.5) / CELLS as f64;
        let cells = (0..CELLS * CELLS).map(|k| {
            let x = Point::new(
                x0 + (x1 - x0) * part(k % CELLS),
                y0 + (y1 - y0) * part(k / CELLS),
                self.args.ground_z_m,
            );
            KnownPoint { position: x, sigma_m: 0.0 }
        });
        let known: Vec<KnownPoint> = cells.collect();
        let names = vec![String::new(); known.len()];
        Ok((known, names, region))
    }

    fn pictures(
        &self,
        next: &NextPoint,
        best: &[Point],
        region_m: [f64; 4],
        with_best: Option<resight::core::Matrix6>,
    ) -> Result<()> {
        if self.args.output.is_none() {
            return Ok(());
        }
        let maps = FurtherPoint {
            view: self.view(&self.marks),
            names: &self.names,
            next,
            aim: self.aim.0,
            aim_name: self.aim.1,
            ground_z_m: self.args.ground_z_m,
            region_m,
            length_m: self.args.length_m,
            best,
        };
        self.args.picture("next-point-ground.png", Some(maps.over_ground()))?;
        self.args.picture("next-point-image.png", maps.over_image())?;
        self.args.picture("places-ground.png", with_best.map(|c| maps.places_over_ground(&c)))?;
        self.args.picture("places-image.png", with_best.and_then(|c| maps.places_over_image(&c)))
    }
}

/// The box of some points, widened by a part of its longer side.
fn around(points: impl Iterator<Item = Point>, part: f64) -> [f64; 4] {
    let [mut x0, mut y0, mut x1, mut y1] =
        [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for p in points {
        (x0, y0, x1, y1) = (x0.min(p.x), y0.min(p.y), x1.max(p.x), y1.max(p.y));
    }
    let by = part * (x1 - x0).max(y1 - y0);
    [x0 - by, y0 - by, x1 + by, y1 + by]
}
