//! The server: messages in, answers out, and diagnostics when the editor rests.

use super::analysis::{Analysis, Checked};
use super::documents::{self, Documents};
use super::index::Role;
use super::transport::{self, Incoming};
use super::{actions, completion, diagnostics, hover, position, rename, symbols, tokens};
use crate::source::{FileId, SourceMap, loader};
use lsp_server::{ErrorCode, Message, Notification, Request, RequestId, Response};
use lsp_types as lsp;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::{self, BufRead, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Diagnostics wait until nothing has been typed for so long.
const REST: Duration = Duration::from_millis(150);

/// Files of a workspace beyond these are not looked at.
const MOST_FILES: usize = 2000;

/// What the server needs from the program around it.
pub struct Host {
    /// Checks a bond graph that is in the map, with these folders for imports.
    pub check: fn(&mut SourceMap, FileId, &[String]) -> Checked,
    /// Folders in which imports are looked for.
    pub folders: Vec<String>,
    /// The folder in which the files of the library stand for reading.
    pub library: Option<String>,
    /// Writes them there; called before the editor is first led to one of them.
    pub write_library: fn(&str),
}

/// Speaks with an editor until it says that it is done. `true` when it said so in the right order.
///
/// # Errors
/// When nothing can be written any more.
pub fn serve(
    host: &Host,
    input: impl BufRead + Send + 'static,
    output: &mut impl Write,
) -> io::Result<bool> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let mut input = input;
        loop {
            let incoming = transport::read(&mut input);
            let end = matches!(incoming, Incoming::End);
            if sender.send(incoming).is_err() || end {
                return;
            }
        }
    });
    let mut server = Server {
        host,
        documents: Documents::new(host.library.clone()),
        workspace: vec![],
        analyses: BTreeMap::new(),
        clock: 1,
        changed: BTreeMap::new(),
        all_changed: 0,
        waiting: BTreeSet::new(),
        published: BTreeMap::new(),
        shown: BTreeMap::new(),
        stage: Stage::Fresh,
        library_written: false,
    };
    server.run(&receiver, output)
}

/// How far the conversation has come.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    Fresh,
    Running,
    ShutDown,
}

pub(super) struct Server<'h> {
    pub host: &'h Host,
    pub documents: Documents,
    /// Folders of the workspace.
    workspace: Vec<String>,
    analyses: BTreeMap<String, (u64, Rc<Analysis>)>,
    /// Counts changes.
    clock: u64,
    /// When each file changed last.
    changed: BTreeMap<String, u64>,
    /// When something changed that may concern all files.
    all_changed: u64,
    /// Open files to be checked when the editor rests.
    waiting: BTreeSet<String>,
    /// By file that was checked, what was found in which file.
    published: BTreeMap<String, BTreeMap<String, Vec<lsp::Diagnostic>>>,
    /// What the editor shows.
    shown: BTreeMap<String, Vec<lsp::Diagnostic>>,
    stage: Stage,
    library_written: bool,
}

/// An answer, or a code and a reason why there is none.
type Answer = Result<Value, (ErrorCode, String)>;

impl Server<'_> {
    fn run(&mut self, receiver: &Receiver<Incoming>, output: &mut impl Write) -> io::Result<bool> {
        let mut queue = VecDeque::new();
        let mut rest_until: Option<Instant> = None;
        loop {
            // All that has come by now, so that what was cancelled or overtaken need not be done.
            queue.extend(receiver.try_iter());
            if queue.is_empty() {
                let next = match rest_until {
                    None => receiver.recv().map_err(|_| RecvTimeoutError::Disconnected),
                    Some(until) => {
                        receiver.recv_timeout(until.saturating_duration_since(Instant::now()))
                    }
                };
                match next {
                    Ok(incoming) => queue.push_back(incoming),
                    Err(RecvTimeoutError::Timeout) => {
                        rest_until = None;
                        self.publish(output)?;
                    }
                    Err(RecvTimeoutError::Disconnected) => return Ok(false),
                }
                continue;
            }
            match queue.pop_front() {
                Some(Incoming::Message(Message::Request(request))) => {
                    let id = request.id.clone();
                    let cancelled = queue.iter().any(|later| cancels(later, &id));
                    let answer = match cancelled {
                        true => Err((ErrorCode::RequestCanceled, "cancelled".to_string())),
                        false => self.guarded(request),
                    };
                    let response = match answer {
                        Ok(value) => Response::new_ok(id, value),
                        Err((code, reason)) => Response::new_err(id, code as i32, reason),
                    };
                    transport::write(output, &response.into())?;
                }
                Some(Incoming::Message(Message::Notification(notification))) => {
                    if notification.method == "exit" {
                        return Ok(self.stage == Stage::ShutDown);
                    }
                    let told = catch_unwind(AssertUnwindSafe(|| self.notify(notification)));
                    // What cannot be followed is left out; the next full text mends it.
                    drop(told);
                    if !self.waiting.is_empty() {
                        rest_until = Some(Instant::now() + REST);
                    }
                }
                Some(Incoming::Message(Message::Response(_))) => {}
                Some(Incoming::Bad(response)) => transport::write(output, &response.into())?,
                Some(Incoming::End) | None => return Ok(self.stage == Stage::ShutDown),
            }
        }
    }

    /// Answers a request; a fault of our own costs this answer and not the conversation.
    fn guarded(&mut self, request: Request) -> Answer {
        let method = request.method.clone();
        match catch_unwind(AssertUnwindSafe(|| self.answer(request))) {
            Ok(answer) => answer,
            Err(_) => Err((ErrorCode::InternalError, format!("`{method}` failed"))),
        }
    }

    fn answer(&mut self, request: Request) -> Answer {
        let Request { method, params, .. } = request;
        match (method.as_str(), self.stage) {
            ("initialize", Stage::Fresh) => return self.initialize(params),
            (_, Stage::Fresh) => {
                let reason = "`initialize` comes first".to_string();
                return Err((ErrorCode::ServerNotInitialized, reason));
            }
            (_, Stage::ShutDown) | ("initialize", _) => {
                let reason = "this cannot be asked any more".to_string();
                return Err((ErrorCode::InvalidRequest, reason));
            }
            ("shutdown", Stage::Running) => {
                self.stage = Stage::ShutDown;
                return Ok(Value::Null);
            }
            (_, Stage::Running) => {}
        }
        match method.as_str() {
            "textDocument/hover" => {
                let params: lsp::HoverParams = parsed(params)?;
                self.hover(&params.text_document_position_params)
            }
            "textDocument/definition" => {
                let params: lsp::GotoDefinitionParams = parsed(params)?;
                self.definition(&params.text_document_position_params)
            }
            "textDocument/references" => {
                let params: lsp::ReferenceParams = parsed(params)?;
                self.references(&params.text_document_position, params.context.include_declaration)
            }
            "textDocument/documentHighlight" => {
                let params: lsp::DocumentHighlightParams = parsed(params)?;
                self.highlight(&params.text_document_position_params)
            }
            "textDocument/prepareRename" => {
                let at: lsp::TextDocumentPositionParams = parsed(params)?;
                self.prepare_rename(&at)
            }
            "textDocument/rename" => {
                let params: lsp::RenameParams = parsed(params)?;
                self.rename(&params)
            }
            "textDocument/completion" => {
                let params: lsp::CompletionParams = parsed(params)?;
                self.completion(&params.text_document_position)
            }
            "textDocument/documentSymbol" => {
                let params: lsp::DocumentSymbolParams = parsed(params)?;
                let (analysis, file) = self.read(&params.text_document.uri)?;
                json(symbols::outline(&analysis, file))
            }
            "textDocument/formatting" => {
                let params: lsp::DocumentFormattingParams = parsed(params)?;
                self.formatting(&params.text_document.uri)
            }
            "textDocument/codeAction" => {
                let params: lsp::CodeActionParams = parsed(params)?;
                let (analysis, _) = self.read(&params.text_document.uri)?;
                let checked = analysis.checked(self.host);
                json(actions::actions(&analysis, checked, &self.documents, params.range))
            }
            "textDocument/semanticTokens/full" => {
                let params: lsp::SemanticTokensParams = parsed(params)?;
                let (analysis, file) = self.read(&params.text_document.uri)?;
                json(lsp::SemanticTokens { result_id: None, data: tokens::tokens(&analysis, file) })
            }
            _ => Err((ErrorCode::MethodNotFound, format!("`{method}` is not known here"))),
        }
    }

    fn initialize(&mut self, params: Value) -> Answer {
        let params: lsp::InitializeParams = parsed(params)?;
        self.stage = Stage::Running;
        let folders = params.workspace_folders.unwrap_or_default();
        self.workspace =
            folders.iter().map(|folder| self.documents.name(folder.uri.as_str())).collect();
        #[allow(deprecated)]
        if let (true, Some(root)) = (self.workspace.is_empty(), params.root_uri) {
            self.workspace.push(self.documents.name(root.as_str()));
        }
        json(lsp::InitializeResult {
            capabilities: capabilities(),
            server_info: Some(lsp::ServerInfo {
                name: "bondspice".to_string(),
                version: Some(env!("CARGO_PKG_VERSION").to_string()),
            }),
        })
    }

    fn notify(&mut self, notification: Notification) {
        if self.stage != Stage::Running {
            return;
        }
        let Notification { method, params } = notification;
        match method.as_str() {
            "textDocument/didOpen" => {
                let Ok(params) = parsed::<lsp::DidOpenTextDocumentParams>(params) else { return };
                let document = params.text_document;
                let name =
                    self.documents.open(document.uri.as_str(), document.text, document.version);
                self.analyses.remove(&name);
                self.touch(&name);
                self.touch_all();
            }
            "textDocument/didChange" => {
                let Ok(params) = parsed::<lsp::DidChangeTextDocumentParams>(params) else { return };
                let document = params.text_document;
                let changes = params.content_changes;
                let changed =
                    self.documents.change(document.uri.as_str(), document.version, changes);
                if let Some(name) = changed {
                    self.touch(&name);
                }
            }
            "textDocument/didClose" => {
                let Ok(params) = parsed::<lsp::DidCloseTextDocumentParams>(params) else { return };
                let name = self.documents.close(params.text_document.uri.as_str());
                self.waiting.insert(name.clone());
                self.touch(&name);
                self.touch_all();
            }
            "textDocument/didSave" | "workspace/didChangeWatchedFiles" => self.touch_all(),
            _ => {}
        }
    }

    /// A file is another one now: so is what reads it.
    fn touch(&mut self, name: &str) {
        self.clock += 1;
        self.changed.insert(name.to_string(), self.clock);
        let concerned: Vec<String> = self
            .documents
            .iter()
            .map(|(open, _)| open.to_string())
            .filter(|open| {
                let known = self.analyses.get(open);
                open == name || known.is_none_or(|(_, analysis)| analysis.files().contains(name))
            })
            .collect();
        self.waiting.extend(concerned);
    }

    /// Anything may be another one now.
    fn touch_all(&mut self) {
        self.clock += 1;
        self.all_changed = self.clock;
        self.waiting.extend(self.documents.iter().map(|(name, _)| name.to_string()));
    }

    /// A file with its imports, as they are now.
    pub fn analysis(&mut self, name: &str) -> Rc<Analysis> {
        if let Some((since, analysis)) = self.analyses.get(name) {
            let newer = |file: &String| self.changed.get(file).is_some_and(|at| at > since);
            if *since >= self.all_changed && !analysis.files().iter().any(newer) {
                return analysis.clone();
            }
        }
        let analysis = Rc::new(Analysis::read(&[name], &self.documents, &self.host.folders));
        self.analyses.insert(name.to_string(), (self.clock, analysis.clone()));
        analysis
    }

    /// Every file of the workspace, and every open one, with their imports.
    pub fn everything(&self) -> Analysis {
        let mut names: BTreeSet<String> =
            self.documents.iter().map(|(name, _)| name.to_string()).collect();
        for folder in &self.workspace {
            let room = MOST_FILES.saturating_sub(names.len());
            names.extend(loader::list(folder, ".bg", room));
        }
        names.retain(|name| is_graph(name));
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        Analysis::read(&names, &self.documents, &self.host.folders)
    }

    /// The analysis of an address, and the file in it.
    fn read(&mut self, uri: &lsp::Uri) -> Result<(Rc<Analysis>, FileId), (ErrorCode, String)> {
        let name = self.documents.name(uri.as_str());
        let analysis = self.analysis(&name);
        match analysis.root() {
            Some(file) => Ok((analysis, file)),
            None => Err((ErrorCode::InvalidParams, format!("there is no file `{name}`"))),
        }
    }

    /// The analysis of a place, the file, and the byte.
    fn place(
        &mut self,
        at: &lsp::TextDocumentPositionParams,
    ) -> Result<(Rc<Analysis>, FileId, usize), (ErrorCode, String)> {
        let (analysis, file) = self.read(&at.text_document.uri)?;
        let byte = position::byte(analysis.text(file), at.position);
        Ok((analysis, file, byte))
    }

    fn hover(&mut self, at: &lsp::TextDocumentPositionParams) -> Answer {
        let (analysis, file, byte) = self.place(at)?;
        let checked = analysis.checked(self.host);
        let found = hover::hover(&analysis, checked, file, byte);
        json(found.map(|(value, span)| lsp::Hover {
            contents: lsp::HoverContents::Markup(lsp::MarkupContent {
                kind: lsp::MarkupKind::Markdown,
                value,
            }),
            range: Some(analysis.range(span)),
        }))
    }

    fn definition(&mut self, at: &lsp::TextDocumentPositionParams) -> Answer {
        let (analysis, file, byte) = self.place(at)?;
        let here = |span: &crate::source::Span| {
            span.file == file && span.start as usize <= byte && byte <= span.end as usize
        };
        let import = analysis.index.imports.iter().find(|import| here(&import.span));
        let spans: Vec<crate::source::Span> = match (analysis.index.at(file, byte), import) {
            (Some(mention), _) => {
                let symbol = analysis.index.symbol(mention.symbol);
                symbol.definitions.iter().map(|definition| definition.name).collect()
            }
            (None, Some(import)) => {
                let start = |file| crate::source::Span::new(file, 0, 0);
                import.file.map(start).into_iter().collect()
            }
            (None, None) => vec![],
        };
        for span in &spans {
            self.provide(analysis.name(span.file));
        }
        let locations = spans.iter().filter_map(|span| analysis.location(*span, &self.documents));
        json(locations.collect::<Vec<_>>())
    }

    /// Writes the files of the library before the editor is led to one of them.
    fn provide(&mut self, name: &str) {
        if let (true, false, Some(folder)) =
            (name.starts_with("std/"), self.library_written, &self.host.library)
        {
            self.library_written = true;
            (self.host.write_library)(folder);
        }
    }

    fn references(&mut self, at: &lsp::TextDocumentPositionParams, declaration: bool) -> Answer {
        let name = self.documents.name(at.text_document.uri.as_str());
        let all = self.everything();
        let Some(file) = all.map.find(&name) else { return Ok(Value::Null) };
        let byte = position::byte(all.text(file), at.position);
        let Some(mention) = all.index.at(file, byte) else { return Ok(Value::Null) };
        let mentions = all.index.mentions(mention.symbol);
        let wanted = mentions.filter(|m| declaration || m.role != Role::Definition);
        let locations = wanted.filter_map(|m| all.location(m.span, &self.documents));
        json(locations.collect::<Vec<_>>())
    }

    fn highlight(&mut self, at: &lsp::TextDocumentPositionParams) -> Answer {
        let (analysis, file, byte) = self.place(at)?;
        let Some(mention) = analysis.index.at(file, byte) else { return Ok(Value::Null) };
        let mentions = analysis.index.mentions(mention.symbol).filter(|m| m.span.file == file);
        let found = mentions.map(|m| lsp::DocumentHighlight {
            range: analysis.range(m.span),
            kind: Some(match m.role {
                Role::Definition => lsp::DocumentHighlightKind::WRITE,
                Role::Use | Role::Implied => lsp::DocumentHighlightKind::READ,
            }),
        });
        json(found.collect::<Vec<_>>())
    }

    fn prepare_rename(&mut self, at: &lsp::TextDocumentPositionParams) -> Answer {
        let (analysis, file, byte) = self.place(at)?;
        let found = rename::target(&analysis, file, byte);
        let (span, name) = found.map_err(|reason| (ErrorCode::RequestFailed, reason))?;
        json(lsp::PrepareRenameResponse::RangeWithPlaceholder {
            range: analysis.range(span),
            placeholder: name,
        })
    }

    fn rename(&mut self, params: &lsp::RenameParams) -> Answer {
        let at = &params.text_document_position;
        let name = self.documents.name(at.text_document.uri.as_str());
        let all = self.everything();
        let Some(file) = all.map.find(&name) else {
            return Err((ErrorCode::InvalidParams, format!("there is no file `{name}`")));
        };
        let byte = position::byte(all.text(file), at.position);
        let edits = rename::rename(&all, self.host, file, byte, &params.new_name)
            .map_err(|reason| (ErrorCode::RequestFailed, reason))?;
        match actions::edits(&all, &self.documents, &edits) {
            Some(edit) => json(edit),
            None => {
                let reason = "it stands in a file that cannot be changed".to_string();
                Err((ErrorCode::RequestFailed, reason))
            }
        }
    }

    fn completion(&mut self, at: &lsp::TextDocumentPositionParams) -> Answer {
        let (analysis, file, byte) = self.place(at)?;
        json(completion::complete(&analysis, file, byte))
    }

    fn formatting(&mut self, uri: &lsp::Uri) -> Answer {
        let (analysis, file) = self.read(uri)?;
        let text = analysis.text(file);
        let edits = match tokens::formatted(&analysis, file) {
            Some(new) if new != text => {
                vec![lsp::TextEdit { range: position::range(text, 0..text.len()), new_text: new }]
            }
            _ => vec![],
        };
        json(edits)
    }

    /// Checks what has changed and tells the editor what is different from before.
    fn publish(&mut self, output: &mut impl Write) -> io::Result<()> {
        for name in std::mem::take(&mut self.waiting) {
            self.published.remove(&name);
            if self.documents.get(&name).is_none() || !is_graph(&name) {
                continue;
            }
            let host = self.host;
            let found = catch_unwind(AssertUnwindSafe(|| {
                let analysis = self.analysis(&name);
                diagnostics::by_file(&analysis, analysis.checked(host), &self.documents)
            }));
            if let Ok(found) = found {
                self.published.insert(name, found);
            }
        }
        let mut all: BTreeMap<String, Vec<lsp::Diagnostic>> = BTreeMap::new();
        for files in self.published.values() {
            for (file, found) in files {
                let row = all.entry(file.clone()).or_default();
                row.extend(found.iter().filter(|d| !row.contains(d)).cloned().collect::<Vec<_>>());
            }
        }
        // A file that nothing is said of any more is cleared.
        let gone: Vec<String> =
            self.shown.keys().filter(|file| !all.contains_key(*file)).cloned().collect();
        all.extend(gone.into_iter().map(|file| (file, vec![])));
        for (file, found) in all {
            let open = self.documents.get(&file);
            let before = self.shown.get(&file);
            if before == Some(&found) || before.is_none() && found.is_empty() && open.is_none() {
                continue;
            }
            let Some(uri) = self.documents.uri(&file) else { continue };
            let params = lsp::PublishDiagnosticsParams {
                uri,
                diagnostics: found.clone(),
                version: open.map(|document| document.version),
            };
            let method = "textDocument/publishDiagnostics".to_string();
            transport::write(output, &Notification::new(method, params).into())?;
            match found.is_empty() && open.is_none() {
                true => self.shown.remove(&file),
                false => self.shown.insert(file, found),
            };
        }
        Ok(())
    }
}

/// Whether a message cancels a request.
fn cancels(message: &Incoming, id: &RequestId) -> bool {
    let Incoming::Message(Message::Notification(notification)) = message else { return false };
    notification.method == "$/cancelRequest"
        && serde_json::from_value::<RequestId>(notification.params["id"].clone())
            .is_ok_and(|cancelled| cancelled == *id)
}

/// Whether a file holds a bond graph, as far as its name tells; what has no name yet may.
fn is_graph(name: &str) -> bool {
    name.ends_with(".bg") || name.starts_with("untitled:")
}

fn parsed<T: DeserializeOwned>(mut params: Value) -> Result<T, (ErrorCode, String)> {
    tidy(&mut params);
    serde_json::from_value(params).map_err(|error| (ErrorCode::InvalidParams, error.to_string()))
}

/// Addresses as they should have been written: some editors leave blanks and letters such as Φ as they are.
fn tidy(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                match value {
                    Value::String(text) if key == "uri" || key == "rootUri" => {
                        *text = documents::escaped(text);
                    }
                    value => tidy(value),
                }
            }
        }
        Value::Array(values) => values.iter_mut().for_each(tidy),
        _ => {}
    }
}

fn json(value: impl serde::Serialize) -> Answer {
    serde_json::to_value(value).map_err(|error| (ErrorCode::InternalError, error.to_string()))
}

fn capabilities() -> lsp::ServerCapabilities {
    let options = lsp::WorkDoneProgressOptions::default();
    lsp::ServerCapabilities {
        text_document_sync: Some(lsp::TextDocumentSyncCapability::Options(
            lsp::TextDocumentSyncOptions {
                open_close: Some(true),
                change: Some(lsp::TextDocumentSyncKind::INCREMENTAL),
                save: Some(lsp::TextDocumentSyncSaveOptions::Supported(true)),
                ..lsp::TextDocumentSyncOptions::default()
            },
        )),
        hover_provider: Some(lsp::HoverProviderCapability::Simple(true)),
        definition_provider: Some(lsp::OneOf::Left(true)),
        references_provider: Some(lsp::OneOf::Left(true)),
        document_highlight_provider: Some(lsp::OneOf::Left(true)),
        document_symbol_provider: Some(lsp::OneOf::Left(true)),
        document_formatting_provider: Some(lsp::OneOf::Left(true)),
        code_action_provider: Some(lsp::CodeActionProviderCapability::Options(
            lsp::CodeActionOptions {
                code_action_kinds: Some(vec![lsp::CodeActionKind::QUICKFIX]),
                ..lsp::CodeActionOptions::default()
            },
        )),
        rename_provider: Some(lsp::OneOf::Right(lsp::RenameOptions {
            prepare_provider: Some(true),
            work_done_progress_options: options,
        })),
        completion_provider: Some(lsp::CompletionOptions {
            trigger_characters: Some([":", ".", "(", ">", " ", "\"", "/"].map(String::from).into()),
            ..lsp::CompletionOptions::default()
        }),
        semantic_tokens_provider: Some(
            lsp::SemanticTokensOptions {
                legend: tokens::legend(),
                full: Some(lsp::SemanticTokensFullOptions::Bool(true)),
                ..lsp::SemanticTokensOptions::default()
            }
            .into(),
        ),
        ..lsp::ServerCapabilities::default()
    }
}
