// A camera watched for motion: `cargo run -p resight-watch --example watch`.
use resight_watch::live::{LiveCamera, LiveConfig, Watched};
use resight_watch::source::pictures::{Clock, ImageFiles};
use resight_watch::{Event, Log, Request, run};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (camera, target) = (resight::read_camera("testdata/demo/left.toml")?, "testdata/demo/grid.toml");
    let target =
        Watched { name: "grid".into(), target: resight::read_target(target)?.into(), reference: None };
    let frames = vec!["testdata/demo/left.png".into(); 60]; // One a second; a stream or a folder in earnest.
    let source = Box::new(ImageFiles::new(frames, Clock::Every(1.0)));
    let camera = LiveCamera { targets: vec![target], ..LiveCamera::new("gate", camera, source) };
    let request = Request::new(vec![camera], LiveConfig { learn_readings: 20, ..Default::default() });
    let ended = run(request, &Log::default(), &Default::default(), |event| {
        if let Event::StateChanged { t_s, state, .. } = event {
            println!("{t_s:.0} s: {state:?}");
        }
        Ok(())
    })?;
    println!("{:?}", ended.verdict());
    Ok(())
}
