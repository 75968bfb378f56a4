//! Pictures of the page in every state, a sheet of five windows each, and the document that shows them:
//! `TACTOMO_GALLERY=$PWD/docs cargo test -p tactomo-tests --test page gallery`.

use std::fmt::Write;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use serde_json::json;

use crate::chromium::Page;
use crate::script::Script;
use crate::stage::in_front_of;
use crate::states::STATES;

/// Windows: two small laptops, a large screen, a phone upright and lying (CSS pixels), and where each is on the sheet (left, top, width).
const WINDOWS: [([u32; 2], [u32; 3]); 5] = [
    ([1920, 1080], [0, 0, 800]),
    ([1366, 768], [808, 0, 560]),
    ([390, 844], [1376, 0, 208]),
    ([1280, 580], [0, 458, 560]),
    ([844, 390], [568, 458, 440]),
];
/// Width and height of a sheet (pixels).
const SHEET: [u32; 2] = [1584, 712];

#[test]
fn gallery() -> Result<()> {
    let Some(folder) = std::env::var_os("TACTOMO_GALLERY") else { return Ok(()) };
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder.join("page"))?;
    in_front_of(Script::start, async |stage| {
        for state in &STATES {
            state.enter(&stage.behind, &stage.browser).await?;
            let mut pictures = Vec::new();
            for ([width, height], place) in WINDOWS {
                stage.browser.resize(width, height).await?;
                tokio::time::sleep(Duration::from_millis(700)).await;
                pictures.push((picture(&stage.browser).await?, place));
            }
            stage.browser.resize(1280, 800).await?;
            state.leave(&stage.browser).await?;
            let file = folder.join("page").join(format!("{}.webp", state.name));
            std::fs::write(&file, sheet(&stage.browser, &pictures).await?)
                .with_context(|| file.display().to_string())?;
        }
        Ok(())
    })?;
    let mut text = "# Every state of the page\n\nEach sheet shows the same state in windows of 1920 x 1080, 1366 x 768, 390 x 844, 1280 x 580 and 844 x 390. \
         The page is the real one; what it is told is made up, so that every state occurs.\n\
         `TACTOMO_GALLERY=$PWD/docs cargo test -p tactomo-tests --test page gallery` takes them again and writes this document.\n"
        .to_owned();
    for state in &STATES {
        write!(text, "\n## {}\n{}\n\n![{}](page/{}.webp)\n", state.name, state.says, state.name, state.name)?;
    }
    Ok(std::fs::write(folder.join("page-states.md"), text)?)
}

/// The window as base64 of a PNG.
async fn picture(page: &Page) -> Result<String> {
    let png = page.client.screenshot().await?;
    // The page makes the sheet, for a browser can decode, scale and encode pictures.
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |bytes: &[u8]| {
        let word = bytes.iter().enumerate().fold(0_u32, |word, (i, byte)| word | u32::from(*byte) << (16 - 8 * i));
        (0..4)
            .map(|i| if i <= bytes.len() { DIGITS[(word >> (18 - 6 * i)) as usize & 63] as char } else { '=' })
            .collect::<String>()
    };
    Ok(png.chunks(3).map(group).collect())
}

/// The pictures on one sheet, as WebP.
async fn sheet(page: &Page, pictures: &[(String, [u32; 3])]) -> Result<Vec<u8>> {
    let script = "const [pictures, [width, height], done] = arguments;
        const sheet = Object.assign(document.createElement('canvas'), { width, height });
        const context = sheet.getContext('2d');
        [context.fillStyle, context.imageSmoothingQuality] = ['#8a8a8a', 'high'];
        context.fillRect(0, 0, width, height);
        (async () => {
          for (const [data, [left, top, across]] of pictures) {
            const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
            const image = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
            context.drawImage(image, left, top, across, Math.round(across * image.height / image.width));
          }
          const blob = await new Promise((made) => sheet.toBlob(made, 'image/webp', 0.6));
          done(Array.from(new Uint8Array(await blob.arrayBuffer())));
        })().catch((error) => done(String(error)));";
    let made = page.client.execute_async(script, vec![json!(pictures), json!(SHEET)]).await?;
    let bytes = made.as_array().with_context(|| made.to_string())?;
    ensure!(bytes.len() > 1000, "a sheet of {} bytes", bytes.len());
    bytes.iter().map(|byte| byte.as_u64().and_then(|byte| u8::try_from(byte).ok()).context("a byte")).collect()
}
