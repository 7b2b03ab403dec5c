//! The atlas as video: H.264 by OpenH264, as it is set for calls, one stream of pictures in and the same out.

use anyhow::{Context, Result, bail};
use openh264::OpenH264API;
use openh264::decoder::Decoder;
use openh264::encoder::{
    Encoder, EncoderConfig, FrameRate, IntraFramePeriod, QpRange, RateControlMode, UsageType,
};
use openh264::formats::{YUVSlices, YUVSource};

/// Quantiser, held for all pictures: finer ones cost bits without visible gain (README.md).
const QP: u8 = 26;

/// The sending end.
pub(super) struct Sender {
    encoder: Encoder,
    width: usize,
    height: usize,
    /// Both planes of colour: grey.
    chroma: Vec<u8>,
}

impl Sender {
    /// Sides are even.
    pub(super) fn new(width: u32, height: u32, hz: f64) -> Result<Sender> {
        let config = EncoderConfig::new()
            .usage_type(UsageType::CameraVideoRealTime)
            .rate_control_mode(RateControlMode::Off)
            .qp(QpRange::new(QP, QP))
            .max_frame_rate(FrameRate::from_hz(hz as f32))
            .intra_frame_period(IntraFramePeriod::from_num_frames(0))
            .skip_frames(false)
            .scene_change_detect(false)
            .adaptive_quantization(false)
            // One thread: more slices would cost bits.
            .num_threads(1);
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config)
            .context("the video encoder does not start")?;
        let (width, height) = (width as usize, height as usize);
        Ok(Sender { encoder, width, height, chroma: vec![128; width * height / 4] })
    }

    /// One picture, of one byte a texel.
    pub(super) fn encode(&mut self, luma: &[u8]) -> Result<Vec<u8>> {
        if luma.len() != self.width * self.height {
            bail!("a picture of {} texels in a video of {} x {}", luma.len(), self.width, self.height);
        }
        let half = self.width / 2;
        let planes = (luma, &self.chroma[..], &self.chroma[..]);
        let picture = YUVSlices::new(planes, (self.width, self.height), (self.width, half, half));
        let stream = self.encoder.encode(&picture).context("the video encoder failed")?;
        Ok(stream.to_vec())
    }
}

/// The receiving end.
pub(super) struct Receiver {
    decoder: Decoder,
}

impl Receiver {
    pub(super) fn new() -> Result<Receiver> {
        Ok(Receiver { decoder: Decoder::new().context("the video decoder does not start")? })
    }

    /// The picture that these bytes bring, without the codec's padding.
    pub(super) fn decode(&mut self, bytes: &[u8], (width, height): (u32, u32)) -> Result<Vec<u8>> {
        let picture = self.decoder.decode(bytes).context("the video decoder failed")?;
        let Some(picture) = picture else { bail!("the video decoder gave no picture") };
        let (width, height) = (width as usize, height as usize);
        if picture.dimensions() != (width, height) {
            bail!("a video of {:?} texels, not {width} x {height}", picture.dimensions());
        }
        let stride = picture.strides().0;
        Ok(picture.y().chunks(stride).take(height).flat_map(|row| &row[..width]).copied().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_come_back_nearly_as_they_were() {
        let (mut sender, mut receiver) = (Sender::new(256, 256, 15.0).unwrap(), Receiver::new().unwrap());
        let mut sizes = Vec::new();
        for time in 0..4 {
            let luma: Vec<u8> = (0..256 * 256u32)
                .map(|i| {
                    let (x, y) = ((i % 256 + 2 * time) as f32, (i / 256) as f32);
                    (127.5 + 120.0 * (0.05 * x).sin() * (0.03 * y).cos()) as u8
                })
                .collect();
            let bytes = sender.encode(&luma).unwrap();
            let back = receiver.decode(&bytes, (256, 256)).unwrap();
            let squares: f64 =
                luma.iter().zip(&back).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
            let rms = (squares / luma.len() as f64).sqrt();
            assert!(rms < 3.0, "{time}: {rms}");
            sizes.push(bytes.len());
        }
        assert!(sizes.iter().all(|size| (10..20_000).contains(size)), "{sizes:?}");
        assert!(sender.encode(&[0; 5]).is_err());
        assert!(Receiver::new().unwrap().decode(b"no video", (256, 256)).is_err());
    }
}
