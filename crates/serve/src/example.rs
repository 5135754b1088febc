//! The example of the page: a photograph that comes with the program, its lens, four corners and a length.

use resight_session::{Command, GivenLens, MeasuredKind, Photograph, Session, Template};

const PHOTOGRAPH: &[u8] = include_bytes!("../../../examples/photo/left03.jpg");
const LENS: &str = include_str!("../../../examples/photo/left.yml");

/// Four inner corners of the chessboard, in order around them: 6 squares of 25 mm along and 4 across.
const CORNERS: [(&str, f64, f64); 4] =
    [("A", 277.1, 72.1), ("B", 519.7, 139.6), ("C", 466.6, 310.2), ("D", 205.9, 217.1)];
const SIDES: [(&str, &str, f64); 2] = [("A", "B", 0.15), ("B", "C", 0.1)];

/// The example, ready to be played with.
pub fn session() -> Result<Session, String> {
    let mut session = Session::new();
    let photograph = Photograph::decode("example.jpg", PHOTOGRAPH.to_vec())?;
    session.add_photograph(photograph).map_err(|refusal| refusal.text)?;
    let lens = GivenLens::File { name: "left.yml".to_owned(), text: LENS.to_owned() };
    let mut commands =
        vec![Command::SetLens { lens }, Command::SetTemplate { template: Template::Rectangle }];
    commands.push(Command::SetSigma { sigma_px: 0.5 });
    for (name, u_px, v_px) in CORNERS {
        commands.push(Command::PutPoint { name: name.to_owned(), u_px, v_px, drag: false, sigma_px: None });
    }
    for (a, b, distance_m) in SIDES {
        let sigma_m = Some(0.0002);
        commands.push(Command::SetDistance { a: a.to_owned(), b: b.to_owned(), distance_m, sigma_m });
    }
    // Four squares across, 100 mm.
    let points = vec![[378.5, 138.1], [310.0, 306.0]];
    commands.push(Command::AddMeasurement {
        name: "four squares".to_owned(),
        what: MeasuredKind::Length,
        points,
    });
    for command in commands {
        if let Some(error) = session.apply(0, command).error {
            return Err(error.text);
        }
    }
    Ok(session)
}
