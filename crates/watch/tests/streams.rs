//! Streams and films through the ffmpeg that is installed, from servers made here: when frames were taken, which of them are torn, when
//! a source ends. Without ffmpeg nothing is tested.

use resight::GrayImage;
use resight_watch::source::stream::{Stream, StreamConfig};
use resight_watch::source::video::{Film, Video};
use resight_watch::source::{Content, Next, Source};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_millis(100);
/// Longest wait for anything that must happen.
const LONG: Duration = Duration::from_secs(60);
/// Each frame at once and for itself.
const H264: [&str; 8] = ["-c:v", "libx264", "-bf", "0", "-g", "10", "-pix_fmt", "yuv420p"];
const TS_PACKET: usize = 188;

fn has_ffmpeg() -> bool {
    let found = Command::new("ffmpeg").arg("-version").output().is_ok();
    if !found {
        println!("ffmpeg is not installed: this test is skipped");
    }
    found
}

/// Ten frames a second of an image that moves.
fn film(name: &str, size: &str, frames: u32, how: &[&str]) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("streams");
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join(name);
    let (picture, frames) = (format!("testsrc=size={size}:rate=10"), frames.to_string());
    let status = Command::new("ffmpeg")
        .args(["-v", "error", "-y", "-f", "lavfi", "-i", &picture, "-frames:v", &frames])
        .args(how)
        .arg(&path)
        .status();
    assert!(status.expect("ffmpeg").success(), "{name}");
    path
}

/// One in ten frames of H.264 is a key frame, every one of motion JPEG.
#[test]
fn key_frames_are_counted() {
    if !has_ffmpeg() {
        return;
    }
    for (name, how, counts) in
        [("key_frames.mp4", &H264[..], [1, 1, 2, 3]), ("key_frames.avi", &["-c:v", "mjpeg"], [1, 10, 11, 25])]
    {
        let mut source = Film::open(film(name, "160x120", 25, how)).expect("a film");
        let mut counted = Vec::new();
        loop {
            match source.next(PATIENCE) {
                Next::Frame(_) => counted.push(source.key_frames().expect("a video")),
                Next::Nothing => {}
                _ => break,
            }
        }
        assert_eq!([0, 9, 10, 24].map(|frame| counted[frame]), counts, "{name}");
    }
}

/// Packets of a transport stream, those of one frame together.
fn by_frame(film: &Path) -> Vec<Vec<u8>> {
    let bytes = std::fs::read(film).expect("a film");
    let mut frames: Vec<Vec<u8>> = Vec::new();
    for packet in bytes.chunks_exact(TS_PACKET) {
        let (begins, pid) = (packet[1] & 0x40 != 0, u16::from_be_bytes([packet[1] & 0x1f, packet[2]]));
        // ffmpeg's first stream; tables come before the first frame.
        if frames.is_empty() || (begins && pid == 0x100 && 3 * TS_PACKET < frames[frames.len() - 1].len()) {
            frames.push(Vec::new());
        }
        if let Some(frame) = frames.last_mut() {
            frame.extend_from_slice(packet);
        }
    }
    frames
}

/// Does the same to everyone who connects; returns the address.
fn serve(mut to: impl FnMut(TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = format!("127.0.0.1:{}", listener.local_addr().expect("an address").port());
    std::thread::spawn(move || listener.incoming().flatten().for_each(&mut to));
    address
}

fn stream(address: &str, lost_after_s: f64) -> Stream {
    let config = StreamConfig { lost_after_s, ends: true, ..StreamConfig::default() };
    Stream::open(address, config).expect("ffmpeg")
}

/// What came until the end: times of capture with those of arrival, and reasons of losses.
fn all(mut stream: Stream) -> (Vec<(f64, Instant)>, Vec<String>) {
    let (mut times, mut lost, end) = (Vec::new(), Vec::new(), Instant::now() + LONG);
    while Instant::now() < end {
        match stream.next(PATIENCE) {
            Next::Frame(frame) if matches!(frame.content, Content::Image(_)) => {
                times.push((frame.capture_s, Instant::now()));
            }
            Next::Frame(_) | Next::Nothing => {}
            Next::Lost(reason) => lost.push(reason.to_string()),
            Next::End => return (times, lost),
        }
    }
    panic!("no end after {} frames and {lost:?}", times.len())
}

/// How many steps are those of ten frames a second, within a tenth of one.
fn even(times_s: &[f64]) -> usize {
    times_s.windows(2).filter(|pair| (pair[1] - pair[0] - 0.1).abs() < 0.01).count()
}

/// A network that delays each frame by something up to 0.3 s: the times are those of the camera, not those of the arrivals.
#[test]
fn delays_of_the_network_are_not_in_the_capture_times() {
    if !has_ffmpeg() {
        return;
    }
    let frames = by_frame(&film("delayed.ts", "320x240", 100, &H264));
    let address = serve(move |mut visitor| {
        let begun = Instant::now();
        for (i, frame) in frames.iter().enumerate() {
            let delay_s = if i % 5 == 0 { 0.0 } else { 0.003 * (i * 37 % 100) as f64 };
            let due = Duration::from_secs_f64(0.1 * i as f64 + delay_s);
            std::thread::sleep(due.saturating_sub(begun.elapsed()));
            // The visitor may leave when it has seen enough.
            let _ = visitor.write_all(frame);
        }
    });
    let (times, lost) = all(stream(&format!("tcp://{address}"), 10.0));
    // Those of the first two seconds are looked at to know what the stream is, and not given.
    assert!(lost.is_empty() && 60 <= times.len(), "{} frames, {lost:?}", times.len());
    // By then a frame has come that was hardly delayed.
    let times = &times[20..];
    let taken: Vec<f64> = times.iter().map(|(taken_s, _)| *taken_s).collect();
    let arrived: Vec<f64> = times.iter().map(|(_, at)| at.duration_since(times[0].1).as_secs_f64()).collect();
    assert!(10 * even(&taken) >= 9 * (taken.len() - 1), "{taken:?}");
    assert!(2 * even(&arrived) < arrived.len(), "the network was too good: {arrived:?}");
}

/// Who looks once has seen enough when the stream is of no more use, whoever would serve it again.
#[test]
fn a_stream_that_is_lost_has_ended_where_an_end_is_wanted() {
    if !has_ffmpeg() {
        return;
    }
    let parts = [film("wide.ts", "320x240", 60, &H264), film("high.ts", "240x320", 40, &H264)];
    let bytes = parts.map(|part| std::fs::read(part).expect("a film")).concat();
    let address = serve(move |mut visitor| {
        // The visitor leaves in the middle.
        let _ = visitor.write_all(&bytes);
    });
    let (times, lost) = all(stream(&format!("tcp://{address}"), 10.0));
    assert!(!times.is_empty() && lost.len() == 1, "{} frames, {lost:?}", times.len());
    assert!(lost[0].contains("from 320×240 to 240×320 px"), "{lost:?}");
}

#[test]
fn frames_that_are_too_large_are_the_reason() {
    if !has_ffmpeg() {
        return;
    }
    let how = ["-c:v", "mjpeg", "-pix_fmt", "yuvj420p", "-f", "matroska"];
    let bytes = std::fs::read(film("large.mkv", "8192x8000", 1, &how)).expect("a film");
    let address = serve(move |mut visitor| {
        // The visitor may leave when it has seen enough.
        let _ = visitor.write_all(&bytes);
    });
    let (times, lost) = all(stream(&format!("tcp://{address}"), 20.0));
    assert!(times.is_empty() && lost.len() == 1 && lost[0].contains("the limit is 64 Mpx"), "{lost:?}");
}

/// How many frames ffmpeg itself complains of.
fn complaints(film: &Path) -> usize {
    let arguments = ["-v", "repeat+warning", "-f", "null", "-"];
    let reported = Command::new("ffmpeg").arg("-i").arg(film).args(arguments).output().expect("ffmpeg");
    String::from_utf8_lossy(&reported.stderr).matches("corrupt decoded frame").count()
}

/// Every seventh frame lacks a packet, and each stands for itself. ffmpeg notices most of these; each complaint finds its frame, and none
/// of the others, which are what they were, is called damaged for it.
#[test]
fn the_torn_frames_themselves_are_called_damaged() {
    if !has_ffmpeg() {
        return;
    }
    let intra = [&H264[..4], &["-g", "1", "-qp", "18", "-pix_fmt", "yuv420p"]].concat();
    let whole = film("whole.ts", "320x240", 150, &intra);
    let mut frames = by_frame(&whole);
    let is_torn = |i: usize| i % 7 == 3;
    for (_, frame) in frames.iter_mut().enumerate().filter(|(i, _)| is_torn(*i)) {
        let at = frame.len() / 2 / TS_PACKET * TS_PACKET;
        frame.drain(at..at + TS_PACKET);
    }
    let torn = whole.with_file_name("torn.ts");
    std::fs::write(&torn, frames.concat()).expect("written");
    let complaints = complaints(&torn);
    let decoded = |film: &Path| Video::open(film).expect("a film").map(Result::ok).collect::<Vec<_>>();
    let (whole, torn): (Vec<Option<GrayImage>>, Vec<Option<GrayImage>>) = (decoded(&whole), decoded(&torn));
    assert_eq!((whole.len(), torn.len()), (150, 150));
    for (i, (whole, torn)) in whole.iter().zip(&torn).enumerate() {
        assert!(is_torn(i) || (torn.is_some() && torn == whole), "frame {i} is as it was");
    }
    let damaged = torn.iter().filter(|frame| frame.is_none()).count();
    assert!(damaged == complaints && 10 <= damaged, "{damaged} of {complaints}");
}

/// A camera with RTSP over TCP, as far as is needed; its packets are those that ffmpeg makes for UDP.
struct RtspCamera {
    film: PathBuf,
}

struct Sender(Child);

impl Drop for Sender {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl RtspCamera {
    /// Until the visitor leaves or the film is over.
    fn answer(&self, mut visitor: TcpStream) -> std::io::Result<()> {
        let packets = UdpSocket::bind("127.0.0.1:0")?;
        packets.set_read_timeout(Some(Duration::from_secs(2)))?;
        let description = self.film.with_extension("sdp");
        // That of an earlier visitor.
        let _ = std::fs::remove_file(&description);
        let _sender = self.send(packets.local_addr()?.port(), &description)?;
        let mut requests = BufReader::new(visitor.try_clone()?);
        loop {
            let (mut head, mut line) = (Vec::new(), String::new());
            while requests.read_line(&mut line)? != 0 && !line.trim().is_empty() {
                head.push(std::mem::take(&mut line));
            }
            let Some(request) = head.first() else { return Ok(()) };
            let count = head.iter().find(|line| line.starts_with("CSeq")).cloned().unwrap_or_default();
            let more = match request.split(' ').next() {
                Some("DESCRIBE") => described(&description),
                Some("SETUP") => {
                    "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\nSession: 1\r\n\r\n".to_string()
                }
                _ => "Session: 1\r\n\r\n".to_string(),
            };
            write!(visitor, "RTSP/1.0 200 OK\r\n{count}{more}")?;
            if request.starts_with("PLAY") {
                return relay(&packets, &mut visitor);
            }
        }
    }

    fn send(&self, port: u16, description: &Path) -> std::io::Result<Sender> {
        let child = Command::new("ffmpeg")
            .args(["-v", "error", "-re", "-i"])
            .arg(&self.film)
            .args(["-c", "copy", "-sdp_file"])
            .arg(description)
            .args(["-f", "rtp", &format!("rtp://127.0.0.1:{port}?pkt_size=1200")])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()?;
        Ok(Sender(child))
    }
}

/// The description, once the sender has written it.
fn described(path: &Path) -> String {
    let end = Instant::now() + LONG;
    loop {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        if text.contains("sprop-parameter-sets") && text.ends_with('\n') {
            let text = format!("{text}a=control:track\r\n");
            return format!("Content-Type: application/sdp\r\nContent-Length: {}\r\n\r\n{text}", text.len());
        }
        assert!(Instant::now() < end, "no description");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Each packet behind `$`, its channel and its length.
fn relay(packets: &UdpSocket, visitor: &mut TcpStream) -> std::io::Result<()> {
    let mut packet = [0; 2048];
    while let Ok(n) = packets.recv(&mut packet) {
        let length = u16::try_from(n).map_err(std::io::Error::other)?.to_be_bytes();
        visitor.write_all(&[&[b'$', 0, length[0], length[1]], &packet[..n]].concat())?;
    }
    Ok(())
}

/// As cameras are asked: the session connects, the camera sends. The camera's silence is an end.
#[test]
fn an_rtsp_camera_is_asked_and_sends() {
    if !has_ffmpeg() {
        return;
    }
    let camera = RtspCamera { film: film("camera.mkv", "320x240", 60, &H264) };
    let address = serve(move |visitor| {
        // The visitor may leave at any time.
        let _ = camera.answer(visitor);
    });
    let (times, lost) = all(stream(&format!("rtsp://{address}/gate"), 5.0));
    assert!(lost.is_empty() && 20 <= times.len(), "{} frames, {lost:?}", times.len());
    let taken: Vec<f64> = times.iter().map(|(taken_s, _)| *taken_s).collect();
    assert!(4 * even(&taken[5..]) >= 3 * (taken.len() - 6), "{taken:?}");
}

/// Everybody on a machine can read how its programs were called.
#[cfg(target_os = "linux")]
#[test]
fn a_password_is_nowhere_in_the_list_of_processes() {
    if !has_ffmpeg() {
        return;
    }
    let bytes = std::fs::read(film("secret.ts", "160x120", 100, &H264)).expect("a film");
    let address = serve(move |mut visitor| {
        let (mut request, mut piece) = (Vec::new(), [0; 1024]);
        while !request.ends_with(b"\r\n\r\n") {
            match visitor.read(&mut piece) {
                Ok(n) if 0 < n => request.extend_from_slice(&piece[..n]),
                _ => return,
            }
        }
        let request = String::from_utf8_lossy(&request).into_owned();
        // me:s3cret
        let answer: &[u8] = match request.contains("Authorization: Basic bWU6czNjcmV0") {
            true => b"HTTP/1.1 200 OK\r\nContent-Type: video/mp2t\r\nConnection: close\r\n\r\n",
            false => {
                b"HTTP/1.1 401 Unauthorized\r\nWWW-Authenticate: Basic realm=\"x\"\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
            }
        };
        let _ = visitor.write_all(answer);
        if answer.starts_with(b"HTTP/1.1 200") {
            for piece in bytes.chunks(TS_PACKET * 20) {
                if visitor.write_all(piece).is_err() {
                    return;
                }
                std::thread::sleep(Duration::from_millis(20));
            }
        }
    });
    let mut stream = stream(&format!("http://me:s3cret@{address}/live.ts"), 20.0);
    let (mut frames, mut looked, end) = (0, 0, Instant::now() + LONG);
    while frames < 5 && Instant::now() < end {
        match stream.next(PATIENCE) {
            Next::Frame(frame) => {
                assert!(!frame.name.contains("s3cret"), "{}", frame.name);
                frames += 1;
            }
            Next::Lost(reason) => panic!("{reason}"),
            Next::Nothing => {}
            Next::End => break,
        }
        for process in std::fs::read_dir("/proc").expect("processes").flatten() {
            let called = std::fs::read(process.path().join("cmdline")).unwrap_or_default();
            let called = String::from_utf8_lossy(&called).into_owned();
            assert!(!called.contains("s3cret"), "{called}");
            looked += usize::from(called.contains("yuv4mpegpipe"));
        }
    }
    assert!(5 <= frames && 0 < looked, "{frames} frames, {looked} looks at ffmpeg");
}

/// A certificate that signed itself, for this machine, with its key; none where `openssl` is missing.
fn self_signed(folder: &Path) -> Option<[PathBuf; 2]> {
    let [certificate, key] = ["certificate.pem", "key.pem"].map(|name| folder.join(name));
    let made = Command::new("openssl")
        .args(["req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"])
        .args(["-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout"])
        .arg(&key)
        .arg("-out")
        .arg(&certificate)
        .output();
    made.is_ok_and(|made| made.status.success()).then_some([certificate, key])
}

/// The film to one visitor, over TLS.
fn serve_secured(film: &Path, [certificate, key]: &[PathBuf; 2]) -> (Sender, String) {
    let port =
        TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a port").port();
    let address = format!("tls://127.0.0.1:{port}");
    let server = Command::new("ffmpeg")
        .args(["-v", "error", "-re", "-i"])
        .arg(film)
        .args(["-c", "copy", "-f", "mpegts", "-listen", "1", "-tls_verify", "0", "-cert_file"])
        .arg(certificate)
        .arg("-key_file")
        .arg(key)
        .arg(&address)
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("ffmpeg");
    // It listens once it has read the film; to ask would be to be its one visitor.
    std::thread::sleep(Duration::from_millis(1500));
    (Sender(server), address)
}

/// Nobody vouches for it: no frame of it is shown, and the reason names the certificate. Named as one's own, it is believed.
#[test]
fn a_self_signed_server_is_believed_only_where_its_certificate_is_named() {
    let tls = Command::new("ffmpeg").args(["-hide_banner", "-h", "protocol=tls"]).output();
    let knows = |tls: &[u8]| String::from_utf8_lossy(tls).contains("-tls_verify");
    if !has_ffmpeg() || !tls.is_ok_and(|tls| knows(&tls.stdout)) {
        println!("ffmpeg has no TLS: this test is skipped");
        return;
    }
    let film = film("secured.ts", "320x240", 60, &H264);
    let Some(files) = self_signed(film.parent().expect("a folder")) else {
        println!("openssl makes no certificate: this test is skipped");
        return;
    };
    let ask = |options: &[&str]| {
        let (_server, address) = serve_secured(&film, &files);
        let input_options = options.iter().map(|word| word.to_string()).collect();
        let config = StreamConfig { lost_after_s: 5.0, ends: true, input_options };
        all(Stream::open(&address, config).expect("ffmpeg"))
    };
    let (times, lost) = ask(&[]);
    assert!(times.is_empty() && !lost.is_empty(), "{} frames of an unknown server, {lost:?}", times.len());
    let own = files[0].display().to_string();
    let (times, lost) = ask(&["-ca_file", &own]);
    assert!(20 <= times.len(), "{} frames, {lost:?}", times.len());
}

/// Motion JPEG over HTTP, `rate_hz` images a second: in parts with a boundary, as cameras send it, or one behind the other.
fn serve_motion_jpeg(rate_hz: f64, in_parts: bool, seconds: f64) -> String {
    let first = film("motion-%03d.jpg", "320x240", 40, &["-pix_fmt", "yuvj420p"]);
    let path = |i: usize| first.with_file_name(format!("motion-{:03}.jpg", i % 40 + 1));
    let images: Vec<Vec<u8>> = (0..40).map(|i| std::fs::read(path(i)).expect("an image")).collect();
    serve(move |mut visitor| {
        // What is asked is the same for all.
        let _ = visitor.read(&mut [0; 4096]);
        let kind = if in_parts { "multipart/x-mixed-replace; boundary=part" } else { "video/x-motion-jpeg" };
        let _ = write!(visitor, "HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nConnection: close\r\n\r\n");
        let begun = Instant::now();
        for i in 0..(rate_hz * seconds) as usize {
            let image = &images[i % images.len()];
            let head =
                format!("--part\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", image.len());
            let head = if in_parts { head } else { String::new() };
            let all = [head.as_bytes(), image.as_slice(), if in_parts { b"\r\n" } else { b"" }].concat();
            if visitor.write_all(&all).is_err() {
                return;
            }
            let due = Duration::from_secs_f64((i + 1) as f64 / rate_hz);
            std::thread::sleep(due.saturating_sub(begun.elapsed()));
        }
    })
}

/// Seconds since 1970 by the clock on the wall.
fn wall_s() -> f64 {
    std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970").as_secs_f64()
}

/// Motion JPEG has no times, and ffmpeg counts 25 frames in what it takes for a second: at 5 a second a minute would pass for 12 s. Each
/// frame has the time on the wall when it arrived, with or without a password, in parts or not.
#[test]
fn streams_without_times_have_those_of_the_wall() {
    if !has_ffmpeg() {
        return;
    }
    for (user, in_parts) in [("", true), ("me:s3cret@", true), ("", false)] {
        let address = serve_motion_jpeg(5.0, in_parts, 14.0);
        let mut stream = stream(&format!("http://{user}{address}/video"), 10.0);
        let (mut late_s, mut taken_s, end) = (Vec::new(), Vec::new(), Instant::now() + LONG);
        while Instant::now() < end {
            match stream.next(PATIENCE) {
                Next::Frame(frame) => {
                    late_s.push(wall_s() - frame.capture_s);
                    taken_s.push(frame.capture_s);
                }
                Next::Nothing => {}
                Next::Lost(reason) => panic!("{reason}"),
                Next::End => break,
            }
        }
        assert!(35 <= taken_s.len(), "{} frames", taken_s.len());
        let worst_s = late_s.iter().map(|late_s| late_s.abs()).fold(0.0, f64::max);
        assert!(worst_s < 1.0, "{user}{in_parts}: {worst_s} s from the wall");
        let spent_s = taken_s[taken_s.len() - 1] - taken_s[0];
        let expected_s = (taken_s.len() - 1) as f64 / 5.0;
        assert!(
            (spent_s - expected_s).abs() < 1.0,
            "{user}{in_parts}: {spent_s} s, {expected_s} on the wall"
        );
    }
}
