#!/bin/sh
# Puts the shipped models, the bad files and small traces into the corpora, under their own names.
cd "$(dirname "$0")/.." || exit 1
for target in parse format elaborate; do
  mkdir -p "fuzz/corpus/$target"
  find models tests/bad -name '*.bg' -size -16k | while read -r file; do
    cp "$file" "fuzz/corpus/$target/$(echo "$file" | tr '/' '_')"
  done
done
mkdir -p fuzz/corpus/deck fuzz/corpus/raw fuzz/corpus/table fuzz/corpus/number
find netlists tests/decks tests/bad -name '*.cir' -size -16k | while read -r file; do
  cp "$file" "fuzz/corpus/deck/$(echo "$file" | tr '/' '_')"
done
find tests/bad/with fuzz/found -name '*.raw' -size -16k -exec cp {} fuzz/corpus/raw/ \;
find tests/bad/with fuzz/found -size -16k \( -name '*.csv' -o -name '*.json' -o -name '*.vcd' -o -name '*.prn' \) \
  -exec cp {} fuzz/corpus/table/ \;
for number in 1 -1.5e-3 4k7 10meg 3mil 1e999 .5u 0x 1µF; do
  printf %s "$number" > "fuzz/corpus/number/$number"
done
