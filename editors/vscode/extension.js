// Starts `bondspice lsp` for .bg files and keeps it running.
"use strict";

const vscode = require("vscode");
const { LanguageClient, TransportKind } = require("vscode-languageclient/node");

let client;

/** The client for the settings as they are now. */
function make() {
  const settings = vscode.workspace.getConfiguration("bondspice");
  const folders = settings.get("include", []).flatMap((folder) => ["-I", folder]);
  const program = {
    command: settings.get("path", "bondspice"),
    args: ["lsp", ...folders],
    transport: TransportKind.stdio,
  };
  return new LanguageClient("bondspice", "bondspice", program, {
    documentSelector: [
      { scheme: "file", language: "bg" },
      { scheme: "untitled", language: "bg" },
    ],
    synchronize: { fileEvents: vscode.workspace.createFileSystemWatcher("**/*.{bg,csv}") },
  });
}

async function start() {
  client = make();
  try {
    await client.start();
  } catch (error) {
    const path = vscode.workspace.getConfiguration("bondspice").get("path");
    vscode.window.showErrorMessage(
      `bondspice: \`${path} lsp\` cannot be started (${error}). ` +
        "Install it with `cargo install --path .`, or set `bondspice.path`.",
    );
  }
}

async function stop() {
  const running = client;
  client = undefined;
  if (running) {
    await running.stop();
  }
}

async function restart() {
  await stop();
  await start();
}

exports.activate = async (context) => {
  context.subscriptions.push(
    vscode.commands.registerCommand("bondspice.restart", restart),
    vscode.workspace.onDidChangeConfiguration(async (change) => {
      if (change.affectsConfiguration("bondspice.path") || change.affectsConfiguration("bondspice.include")) {
        await restart();
      }
    }),
  );
  await start();
};

exports.deactivate = stop;
