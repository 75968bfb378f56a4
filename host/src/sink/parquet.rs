//! Solved frames as a Parquet file: a row a frame, for pandas, Polars, DuckDB and whatever else reads tables.
//!
//! Columns are those of [`schema`], each an optional double; `contact_*` are lists, of a number for each contact (NaN where
//! it is not known), `readings_v`, `touch_v` and `image_s_per_m2` lists too; `excluded` and `choice` are text. Readings are the doubles that were solved, bit for
//! bit; where nothing was read they are NaN.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;
use tactomo_physics::readings::{Readings, Says};
use tactomo_touch::schema::{self, CONTACT_COLUMNS, FRAME_COLUMNS, FrameReport, SHAPE_COLUMNS, TEXT_COLUMNS};

/// Frames that are written together: readings of 16 electrodes of so many take 17 MB.
const FRAMES: usize = 4096;
/// Lists that are no numbers of contacts.
const LISTS: [&str; 3] = ["readings_v", "touch_v", "image_s_per_m2"];

/// Writes solved frames.
pub struct ParquetWriter {
    writer: SerializedFileWriter<BufWriter<File>>,
    /// Numbers of frames and shapes, a column each.
    numbers: Vec<Vec<Option<f64>>>,
    /// Numbers of contacts, and [`LISTS`].
    lists: Vec<Lists>,
    texts: [Vec<ByteArray>; TEXT_COLUMNS.len()],
    frames: usize,
}

/// A column of lists, as Parquet has them: the values of all, and for each value, or empty list, whether it is one and whether it
/// goes on with the list before.
#[derive(Default)]
struct Lists {
    values: Vec<f64>,
    definitions: Vec<i16>,
    repetitions: Vec<i16>,
}

impl Lists {
    fn push(&mut self, list: impl Iterator<Item = f64>) {
        let before = self.values.len();
        self.values.extend(list);
        let added = self.values.len() - before;
        if added == 0 {
            self.definitions.push(0);
            self.repetitions.push(0);
        }
        self.definitions.extend(std::iter::repeat_n(1, added));
        self.repetitions.extend((0..added).map(|index| i16::from(index > 0)));
    }
}

impl ParquetWriter {
    /// Begins a file, with such texts about all of it.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn new(out: BufWriter<File>, about: impl IntoIterator<Item = (String, String)>) -> Result<Self, ParquetError> {
        let about = about.into_iter().map(|(key, value)| KeyValue::new(key, value)).collect();
        let properties =
            WriterProperties::builder().set_compression(Compression::UNCOMPRESSED).set_key_value_metadata(Some(about));
        let message = Arc::new(parse_message_type(&message())?);
        let writer = SerializedFileWriter::new(out, message, Arc::new(properties.build()))?;
        Ok(Self {
            writer,
            numbers: vec![Vec::new(); number_columns().count()],
            lists: list_columns().map(|_| Lists::default()).collect(),
            texts: Default::default(),
            frames: 0,
        })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&mut self, frame: &FrameReport) -> Result<(), ParquetError> {
        let of_frame = FRAME_COLUMNS.iter().map(|column| column.value(frame));
        let of_shape = SHAPE_COLUMNS.iter().map(|column| frame.shape.and_then(|shape| column.value(shape)));
        for (column, value) in self.numbers.iter_mut().zip(of_frame.chain(of_shape)) {
            column.push(value);
        }
        let (contacts, others) = self.lists.split_at_mut(CONTACT_COLUMNS.len());
        for (list, column) in contacts.iter_mut().zip(&CONTACT_COLUMNS) {
            list.push(frame.contacts.iter().map(|contact| column.value(contact).unwrap_or(f64::NAN)));
        }
        let [readings, touch, image] = others else { return Ok(()) };
        readings.push(volts(frame.readings_v));
        touch.push(volts(frame.touch_v));
        image.push(frame.image_s_per_m2.unwrap_or_default().iter().map(|value| f64::from(*value)));
        for (column, text) in self.texts.iter_mut().zip(schema::texts(frame)) {
            column.push(ByteArray::from(text.into_bytes()));
        }
        self.frames += 1;
        if self.frames == FRAMES { self.write_group() } else { Ok(()) }
    }

    /// Writes what is left.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<(), ParquetError> {
        self.write_group()?;
        let mut out = self.writer.into_inner()?;
        Ok(out.flush()?)
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        if std::mem::take(&mut self.frames) == 0 {
            return Ok(());
        }
        let mut group = self.writer.next_row_group()?;
        for column in &mut self.numbers {
            let definitions: Vec<i16> = column.iter().map(|value| i16::from(value.is_some())).collect();
            let values: Vec<f64> = column.drain(..).flatten().collect();
            put(&mut group, &Lists { values, definitions, repetitions: Vec::new() })?;
        }
        for list in &mut self.lists {
            put(&mut group, &std::mem::take(list))?;
        }
        for texts in &mut self.texts {
            if let Some(mut column) = group.next_column()? {
                column.typed::<ByteArrayType>().write_batch(texts, None, None)?;
                column.close()?;
            }
            texts.clear();
        }
        group.close().map(drop)
    }
}

fn put<W: Write + Send>(group: &mut SerializedRowGroupWriter<W>, list: &Lists) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else { return Ok(()) };
    let repetitions = Some(&list.repetitions[..]).filter(|repetitions| !repetitions.is_empty());
    column.typed::<DoubleType>().write_batch(&list.values, Some(&list.definitions), repetitions)?;
    column.close()
}

fn volts(readings: Option<&Readings>) -> impl Iterator<Item = f64> {
    readings.into_iter().flat_map(|readings| {
        let n = readings.electrodes();
        let is_read = move |index: usize| readings.says(index / n, index % n) != Says::Nothing;
        readings.volts().iter().enumerate().map(move |(index, volts)| if is_read(index) { *volts } else { f64::NAN })
    })
}

fn number_columns() -> impl Iterator<Item = &'static str> {
    let frame = FRAME_COLUMNS.iter().map(|column| column.name);
    frame.chain(SHAPE_COLUMNS.iter().map(|column| column.name))
}

fn list_columns() -> impl Iterator<Item = String> {
    let contact = CONTACT_COLUMNS.iter().map(|column| format!("contact_{}", column.name));
    contact.chain(LISTS.map(str::to_owned))
}

/// The columns in Parquet's own words.
fn message() -> String {
    let numbers = number_columns().map(|name| format!("optional double {name};"));
    let lists = list_columns()
        .map(|name| format!("required group {name} (LIST) {{ repeated group list {{ required double element; }} }}"));
    let texts = TEXT_COLUMNS.iter().map(|name| format!("required binary {name} (STRING);"));
    format!("message touch {{ {} }}", numbers.chain(lists).chain(texts).collect::<Vec<_>>().join(" "))
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;
    use tactomo_touch::solve::{FoundContact, Solution};

    use super::*;

    #[test]
    fn frames_come_back_with_their_contacts_and_every_bit_of_their_readings() {
        let path = std::env::temp_dir().join(format!("tactomo-{}.parquet", std::process::id()));
        let mut writer =
            ParquetWriter::new(BufWriter::new(File::create(&path).unwrap()), [("schema".to_owned(), "1".to_owned())])
                .unwrap();
        let readings = |frame: usize| {
            Readings::from_fn(4, |g, e| 0.1 / (1 + frame + 4 * g + e) as f64)
                .saying(|g, _| if g == 2 { Says::Nothing } else { Says::Voltage })
        };
        for frame in 0..FRAMES + 3 {
            let contacts = (0..frame % 3).map(|index| FoundContact::flat(index as f64, 0.5, 1e-3)).collect();
            let (solution, readings) = (Solution { contacts, ..Solution::default() }, readings(frame));
            let sequence = Some(frame as u64);
            writer.write(&FrameReport { sequence, readings_v: Some(&readings), ..FrameReport::of(&solution) }).unwrap();
        }
        writer.finish().unwrap();
        let reader = SerializedFileReader::new(File::open(&path).unwrap()).unwrap();
        assert_eq!((reader.num_row_groups(), reader.metadata().file_metadata().num_rows()), (2, FRAMES as i64 + 3));
        let place =
            |name: &str| number_columns().map(str::to_owned).chain(list_columns()).position(|column| column == name);
        let (x_at, readings_at) = (place("contact_x_m").unwrap(), place("readings_v").unwrap());
        for (frame, row) in reader.get_row_iter(None).unwrap().enumerate() {
            let row = row.unwrap();
            assert_eq!(row.get_double(place("sequence").unwrap()).unwrap(), frame as f64);
            let x_m: Vec<f64> = doubles(row.get_list(x_at).unwrap());
            assert_eq!(x_m, (0..frame % 3).map(|index| index as f64).collect::<Vec<_>>());
            for (index, volts) in doubles(row.get_list(readings_at).unwrap()).into_iter().enumerate() {
                let expected = readings(frame).volts()[index];
                assert!(if index / 4 == 2 { volts.is_nan() } else { volts.to_bits() == expected.to_bits() }, "{frame}");
            }
        }
        std::fs::remove_file(path).unwrap();
    }

    fn doubles(list: &parquet::record::List) -> Vec<f64> {
        use parquet::record::ListAccessor;
        (0..list.len()).map(|index| list.get_double(index).unwrap()).collect()
    }
}
