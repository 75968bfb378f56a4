//! Solved frames as a Parquet file: a row a frame, for pandas, Polars, DuckDB and whatever else reads tables.
//!
//! Columns are those of [`schema`], each in its kind: optional 64-bit integers, booleans and doubles; `contact_*` are lists, of a value for
//! each contact (of a number NaN, of others null where it is not known), `readings_v`, `used_v`, `touch_v` and `image_s_per_m2` lists of numbers too;
//! `excluded`, `choice` and `events` are text. Readings are the doubles that were solved, bit for bit; where nothing was read they are NaN.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::parser::parse_message_type;
use tactomo_physics::readings::Readings;
use tactomo_touch::schema::{self, CONTACT_COLUMNS, FRAME_COLUMNS, FrameReport, Kind, SHAPE_COLUMNS, TEXT_COLUMNS};

/// Frames that are written together: readings of 16 electrodes of so many take 17 MB.
const FRAMES: usize = 4096;
/// Lists that are no numbers of contacts.
const LISTS: [&str; 4] = ["readings_v", "used_v", "touch_v", "image_s_per_m2"];

/// Writes solved frames.
pub struct ParquetWriter {
    writer: SerializedFileWriter<BufWriter<File>>,
    /// Of frames and shapes, then of contacts, then [`LISTS`], in the order of [`columns`].
    columns: Vec<Values>,
    texts: [Vec<ByteArray>; TEXT_COLUMNS.len()],
    frames: usize,
}

/// A column, as Parquet has it: the values that there are, and for each value, gap or empty list, how much of it is there and whether it
/// goes on with the list before.
struct Values {
    kind: Kind,
    values: Vec<f64>,
    definitions: Vec<i16>,
    /// None in a column that has no lists.
    repetitions: Vec<i16>,
}

impl Values {
    fn new(kind: Kind) -> Self {
        Self { kind, values: Vec::new(), definitions: Vec::new(), repetitions: Vec::new() }
    }

    fn push(&mut self, value: Option<f64>) {
        self.definitions.push(i16::from(value.is_some()));
        self.values.extend(value);
    }

    fn push_list(&mut self, list: impl Iterator<Item = Option<f64>>) {
        let before = self.definitions.len();
        for value in list {
            self.repetitions.push(i16::from(self.definitions.len() > before));
            match (self.kind, value) {
                (Kind::Number, value) => {
                    self.values.push(value.unwrap_or(f64::NAN));
                    self.definitions.push(1);
                }
                (_, None) => self.definitions.push(1),
                (_, Some(value)) => {
                    self.values.push(value);
                    self.definitions.push(2);
                }
            }
        }
        if self.definitions.len() == before {
            self.definitions.push(0);
            self.repetitions.push(0);
        }
    }

    /// Writes all of it in its kind, and begins anew.
    fn write(&mut self, mut column: SerializedColumnWriter) -> Result<(), ParquetError> {
        let Self { values, definitions, repetitions, .. } = std::mem::replace(self, Self::new(self.kind));
        let (definitions, repetitions) =
            (Some(&definitions[..]), (!repetitions.is_empty()).then_some(&repetitions[..]));
        match self.kind {
            Kind::Number => column.typed::<DoubleType>().write_batch(&values, definitions, repetitions),
            Kind::Integer => {
                let values: Vec<i64> = values.iter().map(|value| *value as i64).collect();
                column.typed::<Int64Type>().write_batch(&values, definitions, repetitions)
            }
            Kind::Flag => {
                let values: Vec<bool> = values.iter().map(|value| *value != 0.0).collect();
                column.typed::<BoolType>().write_batch(&values, definitions, repetitions)
            }
        }?;
        column.close()
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
            columns: columns().map(|column| Values::new(column.kind)).collect(),
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
        let mut columns = self.columns.iter_mut();
        // The values come first: `zip` takes from both, and asks the first one more.
        of_frame.chain(of_shape).zip(&mut columns).for_each(|(value, column)| column.push(value));
        for (of_contact, column) in CONTACT_COLUMNS.iter().zip(&mut columns) {
            column.push_list(frame.contacts.iter().map(|contact| of_contact.value(contact)));
        }
        for (readings, column) in [frame.readings_v, frame.used_v, frame.touch_v].into_iter().zip(&mut columns) {
            column.push_list(readings.into_iter().flat_map(Readings::read_v).map(Some));
        }
        if let Some(column) = columns.next() {
            column.push_list(frame.image_s_per_m2.unwrap_or_default().iter().map(|value| Some(f64::from(*value))));
        }
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
        for values in &mut self.columns {
            if let Some(column) = group.next_column()? {
                values.write(column)?;
            }
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

/// A column of the file.
struct Column {
    name: String,
    kind: Kind,
    is_list: bool,
}

/// All but the texts, in their order.
fn columns() -> impl Iterator<Item = Column> {
    let one = |name: &str, kind| Column { name: name.to_owned(), kind, is_list: false };
    let list = |name: String, kind| Column { name, kind, is_list: true };
    let frame = FRAME_COLUMNS.iter().map(move |column| one(column.name, column.kind));
    let shape = SHAPE_COLUMNS.iter().map(move |column| one(column.name, Kind::Number));
    let contact = CONTACT_COLUMNS.iter().map(move |column| list(format!("contact_{}", column.name), column.kind));
    let lists = LISTS.iter().map(move |name| list((*name).to_owned(), Kind::Number));
    frame.chain(shape).chain(contact).chain(lists)
}

/// The columns in Parquet's own words.
fn message() -> String {
    let told = |Column { name, kind, is_list }: Column| {
        let kind = match kind {
            Kind::Number if is_list => "required double",
            Kind::Number => "optional double",
            Kind::Integer => "optional int64",
            Kind::Flag => "optional boolean",
        };
        match is_list {
            true => format!("required group {name} (LIST) {{ repeated group list {{ {kind} element; }} }}"),
            false => format!("{kind} {name};"),
        }
    };
    let texts = TEXT_COLUMNS.iter().map(|name| format!("required binary {name} (STRING);"));
    format!("message touch {{ {} }}", columns().map(told).chain(texts).collect::<Vec<_>>().join(" "))
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::{ListAccessor, RowAccessor};
    use tactomo_physics::readings::Says;
    use tactomo_touch::pointer::PointerEvent;
    use tactomo_touch::solve::{Flags, FoundContact, Solution};

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
            let id = |index| (index > 0).then_some(1 << 24 | index as u32);
            let contact = |index| FoundContact { id: id(index), ..FoundContact::flat(index as f64, 0.5, 1e-3) };
            let flags = Flags { misfit: frame == 5, ..Flags::default() };
            let solution = Solution { contacts: (0..frame % 3).map(contact).collect(), flags, ..Solution::default() };
            let readings = readings(frame);
            let report = FrameReport {
                sequence: (frame != 7).then_some(1 << 40 | frame as u64),
                arrived_unix_s: Some(1.79e9 + frame as f64),
                readings_v: Some(&readings),
                events: if frame == 9 { &[PointerEvent::Press] } else { &[] },
                ..FrameReport::of(&solution)
            };
            writer.write(&report).unwrap();
        }
        writer.finish().unwrap();
        let reader = SerializedFileReader::new(File::open(&path).unwrap()).unwrap();
        assert_eq!((reader.num_row_groups(), reader.metadata().file_metadata().num_rows()), (2, FRAMES as i64 + 3));
        let place = |name: &str| {
            columns()
                .map(|column| column.name)
                .chain(TEXT_COLUMNS.map(str::to_owned))
                .position(|known| known == name)
                .unwrap()
        };
        let (x_at, readings_at) = (place("contact_x_m"), place("readings_v"));
        for (frame, row) in reader.get_row_iter(None).unwrap().enumerate() {
            let row = row.unwrap();
            match row.get_long(place("sequence")) {
                Ok(sequence) => assert_eq!(sequence, 1 << 40 | frame as i64),
                Err(_) => assert_eq!(frame, 7, "null where it is not known"),
            }
            assert_eq!(row.get_double(place("arrived_unix_s")).unwrap(), 1.79e9 + frame as f64);
            assert_eq!(row.get_bool(place("misfit")).unwrap(), frame == 5);
            assert_eq!(row.get_string(place("events")).unwrap() == r#"[{"kind":"press"}]"#, frame == 9);
            let ids = row.get_list(place("contact_id")).unwrap();
            let ids: Vec<_> = (0..ids.len()).map(|index| ids.get_long(index).ok()).collect();
            assert_eq!(ids, [None, Some(1 << 24 | 1)][..frame % 3]);
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
        (0..list.len()).map(|index| list.get_double(index).unwrap()).collect()
    }
}
