//! Messages over a pair of streams, each a header with its length and a text of JSON.
//!
//! What is no message costs an answer and not the connection: `lsp_server` would close it, so that only its types are
//! used here.

use lsp_server::{ErrorCode, Message, RequestId, Response};
use std::io::{self, BufRead, Read, Write};

/// The longest message, in bytes.
const LIMIT: usize = 256 << 20;

/// What comes next from a client.
#[derive(Debug)]
pub enum Incoming {
    /// A message.
    Message(Message),
    /// Something of the right length that is no message: how to answer.
    Bad(Response),
    /// The stream has ended, or goes on in a way that nobody can follow.
    End,
}

/// Reads the next message.
pub fn read(input: &mut impl BufRead) -> Incoming {
    match content(input) {
        Ok(Some(bytes)) => message(&bytes),
        Ok(None) | Err(_) => Incoming::End,
    }
}

/// The text of the next message; `None` at the end of the stream.
fn content(input: &mut impl BufRead) -> io::Result<Option<Vec<u8>>> {
    let mut length = None;
    loop {
        let mut line = vec![];
        // A header is a short line of text.
        if input.by_ref().take(4096).read_until(b'\n', &mut line)? == 0 {
            return Ok(None);
        }
        let line = String::from_utf8_lossy(&line);
        let line = line.trim();
        if line.is_empty() {
            match length {
                Some(_) => break,
                None => continue,
            }
        }
        if let Some((name, value)) = line.split_once(':')
            && name.trim().eq_ignore_ascii_case("content-length")
        {
            length = value.trim().parse::<usize>().ok();
        }
    }
    let Some(length) = length.filter(|length| *length <= LIMIT) else { return Ok(None) };
    let mut bytes = vec![];
    input.by_ref().take(length as u64).read_to_end(&mut bytes)?;
    Ok((bytes.len() == length).then_some(bytes))
}

fn message(bytes: &[u8]) -> Incoming {
    let value: serde_json::Value = match serde_json::from_slice(bytes) {
        Ok(value) => value,
        Err(error) => {
            return bad(None, ErrorCode::ParseError, &format!("this is no JSON: {error}"));
        }
    };
    let id = match &value["id"] {
        serde_json::Value::Number(number) => {
            number.as_i64().and_then(|id| i32::try_from(id).ok()).map(RequestId::from)
        }
        serde_json::Value::String(text) => Some(RequestId::from(text.clone())),
        _ => None,
    };
    match serde_json::from_value(value) {
        Ok(message) => Incoming::Message(message),
        Err(_) => bad(
            id,
            ErrorCode::InvalidRequest,
            "neither a request, nor a notification, nor an answer",
        ),
    }
}

fn bad(id: Option<RequestId>, code: ErrorCode, text: &str) -> Incoming {
    // The protocol asks for a null where the number of the request cannot be told; these types know none.
    let id = id.unwrap_or_else(|| RequestId::from(String::new()));
    Incoming::Bad(Response::new_err(id, code as i32, text.to_string()))
}

/// Writes a message.
///
/// # Errors
/// What the system says.
pub fn write(output: &mut impl Write, message: &Message) -> io::Result<()> {
    message.clone().write(output)?;
    output.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> Vec<String> {
        let mut input = io::BufReader::new(text.as_bytes());
        let mut found = vec![];
        loop {
            found.push(match read(&mut input) {
                Incoming::Message(Message::Request(request)) => request.method,
                Incoming::Message(Message::Notification(notification)) => notification.method,
                Incoming::Message(Message::Response(_)) => "answer".into(),
                Incoming::Bad(response) => {
                    format!("bad {}", response.response_result.unwrap_err().code)
                }
                Incoming::End => return found,
            });
        }
    }

    fn framed(text: &str) -> String {
        format!("Content-Length: {}\r\n\r\n{text}", text.len())
    }

    #[test]
    fn what_is_no_message_does_not_end_the_stream() {
        let request = framed(r#"{"jsonrpc":"2.0","id":1,"method":"a","params":{}}"#);
        let note = framed(r#"{"jsonrpc":"2.0","method":"b"}"#).replace("Length", "LENGTH");
        let text = [
            request.clone(),
            framed("{"),
            framed("[1]"),
            framed("null"),
            framed(r#"{"id":7}"#),
            framed(&"[".repeat(100_000)),
            note,
            request,
        ]
        .concat();
        let found = all(&text);
        assert_eq!(found[0], "a");
        assert_eq!(found[1], "bad -32700");
        assert_eq!(found[2..4], ["bad -32600", "bad -32600"]);
        assert_eq!(found[5..], ["bad -32700", "b", "a"]);
    }

    #[test]
    fn a_stream_that_cannot_be_followed_ends() {
        assert!(all("nonsense").is_empty());
        assert!(all("Content-Length: x\r\n\r\n{}").is_empty());
        assert!(all("Content-Length: 99999999999999\r\n\r\n{}").is_empty());
        assert!(all("Content-Length: 10\r\n\r\n{}").is_empty());
    }
}
