//! Bags of ROS 2 in SQLite (`.db3`): the tables `topics` and `messages`, in the order of writing.
//!
//! Read first: `rosbag2_storage_sqlite3` of ROS 2. The file may be anything: only plain tables are read (no views, which
//! could compute for ever), no value is longer than a block, and rows must come in rising order, so that
//! pages that point to each other in a circle end the reading.

use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::mcap::{Channel, Message, Schema};
use rusqlite::limits::Limit as SqliteLimit;
use rusqlite::{Connection, OpenFlags};
use tempfile::NamedTempFile;

use super::file::Container;
use super::message_definition::{Stated, name_of};
use super::records::Stop;
use crate::error::{RecordingError, Result, shown};
use crate::limits::{BLOCK, DEFINITIONS, TOPICS};

/// Bytes and rows of messages that are read at once.
const BATCH: (usize, usize) = (1 << 20, 256);

/// An open database of which the messages after a row are still to be read.
pub(super) struct Database {
    path: PathBuf,
    connection: Connection,
    channels: BTreeMap<i64, Arc<Channel<'static>>>,
    /// The row of the last message.
    last: i64,
    ready: VecDeque<Message<'static>>,
    /// Why there is nothing after what is ready.
    stop: Option<Stop>,
    unpacked: Option<Arc<NamedTempFile>>,
}

impl Database {
    /// Opens a file; `unpacked` is the temporary file at that path, which is kept while it is read.
    pub(super) fn open(
        path: &Path,
        unpacked: Option<Arc<NamedTempFile>>,
        file: &str,
    ) -> Result<Self> {
        let damaged = |error: rusqlite::Error| RecordingError::damaged(file, why(&error));
        let connection = connect(path).map_err(damaged)?;
        for table in ["topics", "messages"] {
            if !has_table(&connection, table).map_err(damaged)? {
                let problem = format!(
                    "it is a database of SQLite without a table `{table}`, so no bag of ROS 2"
                );
                return Err(RecordingError::unsupported(file, problem));
            }
        }
        // Pages of a damaged file may be counted for ever.
        let count = "SELECT count(*) FROM (SELECT 1 FROM main.topics LIMIT ?1)";
        let count = connection.query_row(count, [TOPICS.most as i64 + 1], |row| row.get(0));
        let topics: i64 = count.map_err(damaged)?;
        if topics as u64 > TOPICS.most {
            return Err(TOPICS.exceeded(format!("more than {}", TOPICS.most), file, ""));
        }
        let (bytes, channels) = channels(&connection).map_err(damaged)?;
        DEFINITIONS.check(bytes, file, "")?;
        Ok(Self {
            path: path.to_owned(),
            connection,
            channels,
            last: i64::MIN,
            ready: VecDeque::new(),
            stop: None,
            unpacked,
        })
    }

    /// Reads the next rows; what cannot be read ends the recording behind what could.
    fn fill(&mut self) -> std::result::Result<(), rusqlite::Error> {
        let mut select = self.connection.prepare_cached(
            "SELECT rowid, topic_id, timestamp, data FROM main.messages WHERE rowid > ?1 ORDER BY rowid LIMIT ?2",
        )?;
        let mut rows = select.query((self.last, BATCH.1 as i64))?;
        let mut bytes = 0;
        while bytes < BATCH.0 {
            let Some(row) = rows.next()? else {
                return Ok(());
            };
            let (id, topic, time): (i64, i64, i64) = (row.get(0)?, row.get(1)?, row.get(2)?);
            if id <= self.last {
                self.stop = Some(Stop::Cut("its rows are out of order".to_owned()));
                return Ok(());
            }
            self.last = id;
            let Some(channel) = self.channels.get(&topic) else {
                continue;
            };
            let data = row.get_ref(3)?.as_bytes().unwrap_or_default();
            // A row counts more than its bytes, so that empty ones are bounded, too.
            bytes += data.len() + 64;
            let log_time = u64::try_from(time).unwrap_or_default();
            self.ready.push_back(Message {
                channel: Arc::clone(channel),
                sequence: 0,
                log_time,
                publish_time: log_time,
                data: Cow::Owned(data.to_vec()),
            });
        }
        Ok(())
    }
}

impl Container for Database {
    fn format(&self) -> &'static str {
        "rosbag2-sqlite"
    }

    fn next(&mut self) -> std::result::Result<Option<Message<'static>>, Stop> {
        // A batch may be of topics that are not known; then the next one is read.
        while self.ready.is_empty() && self.stop.is_none() {
            let before = self.last;
            if let Err(error) = self.fill() {
                self.stop = Some(Stop::Cut(why(&error)));
            } else if self.last == before {
                return Ok(None);
            }
        }
        match self.ready.pop_front() {
            Some(message) => Ok(Some(message)),
            None => self.stop.clone().map_or(Ok(None), Err),
        }
    }

    fn another(&self, file: &str) -> Result<Box<dyn Container>> {
        Ok(Box::new(Self::open(
            &self.path,
            self.unpacked.clone(),
            file,
        )?))
    }
}

fn why(error: &rusqlite::Error) -> String {
    format!("SQLite says: {}", shown(&error.to_string()))
}

/// Opens the file without writing beside it, unless its recorder was stopped and left a log of what is to be put into it.
fn connect(path: &Path) -> rusqlite::Result<Connection> {
    let mut log = path.as_os_str().to_owned();
    log.push("-wal");
    let has_log = std::fs::metadata(log).is_ok_and(|log| log.len() > 0);
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = if has_log {
        Connection::open_with_flags(path, flags)?
    } else {
        let mut name = "file:".to_owned();
        for byte in std::path::absolute(path)
            .unwrap_or_else(|_| path.to_owned())
            .to_string_lossy()
            .bytes()
        {
            match byte {
                b'/' | b'.' | b'-' | b'_' | b':' | b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' => {
                    name.push(char::from(byte));
                }
                b'\\' => name.push('/'),
                other => name.push_str(&format!("%{other:02x}")),
            }
        }
        name.push_str("?immutable=1");
        Connection::open_with_flags(name, flags | OpenFlags::SQLITE_OPEN_URI)?
    };
    connection.set_limit(SqliteLimit::SQLITE_LIMIT_LENGTH, BLOCK.most as i32)?;
    connection.execute_batch("PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON;")?;
    // A file that is cut off is refused as a whole, unless this is said; it is opened to be read alone.
    let is_cut = |error: &rusqlite::Error| {
        error.sqlite_error_code() == Some(rusqlite::ErrorCode::DatabaseCorrupt)
    };
    let first = "SELECT count(*) FROM (SELECT 1 FROM main.sqlite_master LIMIT 1)";
    match connection.query_row(first, (), |_| Ok(())) {
        Err(error) if is_cut(&error) => {
            connection.execute_batch("PRAGMA writable_schema = ON")?;
        }
        first => first?,
    }
    Ok(connection)
}

/// Whether there is a plain table of this name: no view, no virtual table, and all its columns are stored.
fn has_table(connection: &Connection, name: &str) -> rusqlite::Result<bool> {
    let mut select =
        connection.prepare("SELECT type, sql FROM main.sqlite_master WHERE name = ?1 LIMIT 2")?;
    let mut rows = select.query([name])?;
    let Some(row) = rows.next()? else {
        return Ok(false);
    };
    let (kind, sql): (String, Option<String>) = (row.get(0)?, row.get(1)?);
    let sql = sql.unwrap_or_default().to_ascii_uppercase();
    let computes = sql.contains(" VIRTUAL ") || sql.contains(" AS ") || sql.contains(" AS(");
    Ok(kind == "table" && !computes && rows.next()?.is_none())
}

/// The topics as channels, and how many bytes their names and definitions have.
fn channels(
    connection: &Connection,
) -> rusqlite::Result<(u64, BTreeMap<i64, Arc<Channel<'static>>>)> {
    let (mut bytes, definitions) = definitions(connection)?;
    // Recorders of older versions wrote no hash.
    let hash = match has_column(connection, "topics", "type_description_hash")? {
        true => "type_description_hash",
        false => "''",
    };
    let mut select = connection.prepare(&format!(
        "SELECT id, name, type, serialization_format, {hash} FROM main.topics LIMIT {}",
        TOPICS.most
    ))?;
    let mut rows = select.query(())?;
    let mut channels = BTreeMap::new();
    while let Some(row) = rows.next()?
        && bytes <= DEFINITIONS.most
    {
        let (id, topic, name): (i64, String, String) = (row.get(0)?, row.get(1)?, row.get(2)?);
        let hash: Option<String> = row.get(4)?;
        bytes += (topic.len() + name.len()) as u64;
        let stated = Stated {
            encoding: "ros2msg",
            definition: definitions.get(&name).map_or("", String::as_str),
            hash: hash.as_deref().unwrap_or_default(),
        };
        let number = channels.len() as u16;
        let schema = Schema {
            id: number.saturating_add(1),
            name: name_of(&name, stated),
            encoding: "ros2msg".to_owned(),
            data: Cow::Borrowed(b""),
        };
        let channel = Channel {
            id: number,
            topic,
            schema: Some(Arc::new(schema)),
            message_encoding: row.get(3)?,
            metadata: BTreeMap::new(),
        };
        channels.insert(id, Arc::new(channel));
    }
    Ok((bytes, channels))
}

/// The definitions of types that newer recorders write, and how many bytes they have.
fn definitions(connection: &Connection) -> rusqlite::Result<(u64, BTreeMap<String, String>)> {
    let (mut bytes, mut definitions) = (0, BTreeMap::new());
    if !has_table(connection, "message_definitions")? {
        return Ok((bytes, definitions));
    }
    let mut select = connection.prepare(
        "SELECT topic_type, encoded_message_definition FROM main.message_definitions WHERE encoding = 'ros2msg' LIMIT 65536",
    )?;
    let mut rows = select.query(())?;
    while let Some(row) = rows.next()?
        && bytes <= DEFINITIONS.most
    {
        let (name, definition): (String, String) = (row.get(0)?, row.get(1)?);
        bytes += (name.len() + definition.len()) as u64;
        definitions.insert(name, definition);
    }
    Ok((bytes, definitions))
}

fn has_column(connection: &Connection, table: &str, column: &str) -> rusqlite::Result<bool> {
    let mut select =
        connection.prepare("SELECT 1 FROM pragma_table_info(?1, 'main') WHERE name = ?2")?;
    select.exists((table, column))
}
