#!/bin/sh
# Puts the shipped models and the bad files into the corpora, under their own names.
cd "$(dirname "$0")/.." || exit 1
for target in parse format elaborate; do
  mkdir -p "fuzz/corpus/$target"
  find models tests/bad -name '*.bg' -size -16k | while read -r file; do
    cp "$file" "fuzz/corpus/$target/$(echo "$file" | tr '/' '_')"
  done
done
