// Lengths in photographs with their 95 % intervals: `cargo run -p resight --example measure`.
use resight::measure::read_scene;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = read_scene("testdata/measure/accident.toml")?;
    let answer = resight::measure(&scene)?;
    for query in &answer.answers {
        println!("{}", serde_json::to_string(query)?);
    }
    println!("all ok: {}", answer.is_ok());
    Ok(())
}
