//! Every code of a diagnostic, one row each: what it means in a line, and what to do about it.
//!
//! Codes are stable: a row may be reworded, never renumbered. The hundreds say the stage, and with it the exit code:
//!
//! | codes | stage | exit code |
//! |---|---|---|
//! | 01 | characters and syntax | 3 |
//! | 02 | names and language | 3 |
//! | 03 | units and domains | 3 |
//! | 04 | structure of the graph, causality | 3 |
//! | 05 | initial values, the graph's equations | 3 |
//! | 06 | translation | 3 |
//! | 07 | netlists and circuits | 3 |
//! | 08 | simulation (0806, 0807, 0810: what was asked for) | 4 (3) |
//! | 0900-0919 | files | 5 |
//! | 0920-0939 | data files: traces, maps, lists of times | 3 |
//! | 0940-0999 | usage | 2 |
//! | 10 | drawings, plots | 3 |
//! | 12 | sweeps | 3 |

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Code {
    /// `E0101`; E errors, W warnings, N notes.
    pub code: &'static str,
    /// What it means, in a line.
    pub title: &'static str,
    /// Why it arises and how to mend it.
    pub explanation: &'static str,
}

const fn row(code: &'static str, title: &'static str, explanation: &'static str) -> Code {
    Code { code, title, explanation }
}

/// Every code, one row a line, each stage's rows in order (E, then W, then N).
#[rustfmt::skip]
pub const CODES: &[Code] = &[
    // -- 01: characters and syntax
    row("E0101", "statement cannot be read", "The statement is not of a form of the language. The message says what was expected where. Reading goes on at the next statement."),
    row("E0102", "character means nothing", "The character belongs to no word, number or sign of the language. Typographic signs such as `→`, `−`, `×` have plain spellings: `->`, `-`, `*`. Comments may hold anything."),
    row("E0103", "text in quotes is not closed", "A text in quotes ends on the line on which it began."),
    row("E0104", "bracket is never closed", "Every `(`, `[` and `{` needs its closing bracket. Until it comes, line ends do not end the statement."),
    row("E0105", "brackets do not match", "A closing bracket closes the last one opened, of the same sort."),
    row("E0107", "number is too large", "Numbers are held in double precision: up to about 1.8e308 in SI."),
    row("E0108", "nothing is written", "A value is needed where nothing stands."),
    row("E0109", "list within a chain", "A comma list of ends, as in `a -> R:r, C:c`, stands only at the end of a chain: each item is one end. Begin a new statement to go on from one of them."),
    row("E0110", "nested too deeply", "Brackets, conditionals and operations within one another have a limit, so that no text can exhaust the memory of the tool. Name a part of the expression as a parameter or a signal."),
    row("E0111", "form of argument not allowed here", "Functions take plain values separated by commas; `;`, `name =` and arrows belong to other forms. A bond is read by the names of its two ends, as in `f(a -> b)`."),
    row("E0112", "wrong number of arguments", "The function takes another number of arguments than were given."),
    row("E0113", "comparisons do not chain", "`a < b < c` would compare the truth of `a < b` with c. Write `a < b and b < c`."),
    row("E0114", "`;` between arguments", "Arguments of elements are separated by commas. `;` separates the points of `pwl` and the rows of tables."),
    row("E0115", "said twice", "`until` and `step` stand at most once in `simulate`."),
    row("E0191", "text is not UTF-8", "Sources are UTF-8. Save the file as UTF-8; the message says at which byte the first bad one stands."),
    row("E0192", "file is binary", "The file holds zero bytes, so it is no source text. RAW files are results: read them with `bondspice trace` or `bondspice compare`."),
    row("E0193", "file is empty", "There is nothing in the file but blanks. A bond graph needs at least two ports joined by a bond, a netlist a title and a device."),
    row("N0101", "the rest is not looked at", "After many errors of syntax the text is probably no bond graph; the rest of it is skipped."),
    // -- 02: names and language
    row("E0203", "name is declared twice", "Exactly one occurrence of an element's name carries its kind; elsewhere the name alone means it. Parameters, signals and inputs share one space of names; elements have their own, so `I:L` may take the parameter `L`."),
    row("E0204", "unknown kind of element", "Before the colon stands the kind: 0 1 Se MSe Sf MSf R MR C MC I MI IC MIC TF MTF GY MGY De Df."),
    row("E0205", "reserved name", "e, f, q, p, time and pi mean something of their own in laws and cannot name parameters or signals. Elements may have these names."),
    row("E0206", "unknown element", "A bond or a reading speaks of an element that is declared nowhere. An element is declared by its kind before a colon, once: `1:shaft`."),
    row("E0207", "element has no value", "An element without arguments takes the parameter or signal of its own name, as on a drawing. Neither was found."),
    row("E0208", "unknown name", "No parameter or signal has this name. Variables of elements are read as e(name), f(name), q(name), p(name), power(name)."),
    row("E0209", "wrong arguments of an element", "Sources take a value; R, C and I a value or a law; C and I also an initial value; fields a matrix, or a law for each port; TF and GY a ratio or `gain = …`; junctions and detectors nothing."),
    row("E0210", "unknown function", "No function has this name; names in `.bg` files are case-sensitive. The message names the nearest one."),
    row("E0211", "changes with time", "Parameters, initial values, the arguments of waveforms and the times of `simulate` are numbers that parameters give. Signals, readings and `time` cannot stand in them."),
    row("E0212", "parameters in a circle", "The value of a parameter depends on itself. The order of parameters in the file never matters, but one must come first."),
    row("E0213", "no finite value", "The value came out infinite or as no number, as 1/0 and the root of −1 do."),
    row("E0214", "cannot be read", "A 0-junction has a common effort and no common flow, a 1-junction the reverse; q is read of compliances, p of inertias; a two-port is read at a port, e(t.1). The bonds of a junction are read one by one: f(a -> b)."),
    row("E0215", "no such bond", "A bond is read by its two ends in the direction of its half arrow, f(a -> b), and by its number in square brackets where there are several."),
    row("E0216", "wrong arguments of a function", "The message shows the function's form; arguments in square brackets may be left out, and each may be named: `pi(x, Kp = 2)`."),
    row("E0217", "own variable out of place", "e, f, q and p alone are the own variables of the element whose law they stand in: f in `e = …`, e in `f = …`, q or p in laws of storages. Elsewhere write whose they are: f(shaft)."),
    row("E0219", "not an input", "`drive` says what an input gets. Signals have laws of their own, parameters have values."),
    row("E0220", "statement said twice", "An input is driven once, and a file has one `simulate`."),
    row("E0221", "two columns of one name", "Each column needs a header of its own; `as \"name\"` gives one."),
    row("E0223", "no such parameter to set", "--set NAME=VALUE sets a parameter of the file."),
    row("E0224", "not a signal", "`output` names signals of the file."),
    row("E0225", "a memory in what is observed", "Looking must not change a model: functions with memory and waveforms need a signal of their own, which can then be observed."),
    row("E0226", "time is not positive", "The end of a run and its output interval are positive times."),
    row("E0227", "input is not driven", "A run needs to know what each input gets: `drive NAME = …` in the file, or --drive on the command line. Checking and converting take it as 0."),
    row("E0230", "import not found", "An import is looked for beside the file that imports, then in the folders given with -I; `std/…` is the library that comes with the program."),
    row("E0231", "imports in a circle", "Files that import each other have no beginning. Put what both need into a file of its own, and let both import that."),
    row("E0232", "not a whole number", "Indices and the bounds of loops and sums count things, so they are whole numbers that are known before the graph is."),
    row("E0233", "model called like a kind", "The kinds of elements, such as R and TF, keep their meaning; a model needs another name."),
    row("E0234", "wrong arguments of an instance", "An instance takes the parameters in the brackets after its model's name, and the model's inputs, each by its name: `DcMotor:motor(Jmp = 2e-3 kg*m^2)`. A file used as a model takes all its parameters."),
    row("E0235", "parameter of a model is not given", "A parameter that stands in the brackets of a model without a value has to be given by each instance."),
    row("E0236", "statement out of place", "Imports, models, and what a run does (`simulate`, `options`, `observe`) belong to a file as a whole; they cannot stand within braces."),
    row("E0237", "too large", "The graph or sum grows beyond the limit, mostly because the bound of a loop is not what was meant."),
    row("E0238", "declared in each round of a loop", "The body of a loop is carried out once for each value of its variable. What it declares needs an index, as in `R:r[k]`, so that each round makes another one; what is to be one for all is declared outside."),
    row("E0239", "model contains itself", "An instance of a model within itself, directly or through other models, would never end."),
    row("E0240", "unknown domain", "The domains are those of the table in the language reference, such as electrical, rotation, translation, hydraulic and thermal."),
    row("E0241", "private to its model", "From outside a model its outputs and the parameters of its brackets can be used. What is observed may look at everything."),
    row("E0242", "not a regulator", "`loop` names a regulator: a signal made with `pi` or `pid` alone, whose gains are to be designed."),
    row("E0250", "argument out of its range", "The argument of the function must be above 0, or not below 0, as the message says: a time constant, a frequency, a duration."),
    row("E0251", "abscissae of a table do not rise", "A table says one value for each abscissa, in rising order; between them it goes in straight lines, beyond them it holds its end values."),
    row("E0252", "file of a table cannot be read", "A table's file has two columns of numbers in SI, separated by commas (or semicolons, or blanks). A first line without numbers is a header; a unit in square brackets in it holds for its column. Lines that begin with `#` are skipped."),
    row("W0201", "input is not driven", "The input is taken as 0. `drive NAME = …` says what it gets; a simulation needs it."),
    row("W0202", "own variable hides a name", "In the laws of a field q1, p2, e1, f2 and so on are its own variables. A parameter or signal of the same name cannot be meant there; give it another name."),
    row("W0203", "nothing reads a signal", "The file says what is observed, and neither that nor a law, another signal, a regulator or an `output` speaks of this signal: it has no effect. A file without `observe` shows all its signals."),
    // -- 03: units and domains
    row("E0301", "unknown unit", "A name right after a number, with at most one blank between, is its unit. Known are the units of the SI with its prefixes and bar, psi, L, min, h, rpm, rev, deg, inch, g, Ohm, degC and %; a product needs a `*`."),
    row("E0302", "malformed unit", "A unit is a product of powers of unit names without blanks, as `m^3/(s*Pa)`. Exponents are rational and of moderate size."),
    row("E0303", "units do not agree", "The unit is of another dimension than the value."),
    row("E0304", "values of two units meet", "Sums, differences, comparisons, the branches of `if` and the arguments of `min`, `max`, `clamp` and the like are of one unit. A bare number as a whole value agrees with anything; as a factor, dividend, divisor or exponent it is a pure number: write its unit if it has one."),
    row("E0305", "pure number needed", "Exponents and the arguments of `exp`, `ln`, `sin` and their like are pure numbers (angles in rad among them). Divide by a value of the same unit, or give a factor its unit: sin(2 rad/s*time)."),
    row("E0306", "argument of a function of a wrong unit", "The arguments of a function hang together: the limits of a regulator are in the unit of its output, its Ki in that of Kp per second, times are in seconds, the values of one column of a table in one unit."),
    row("E0307", "value does not fit its bond", "The domain of a bond says the units of its effort and flow, and so those of resistances, compliances, inertias and initial values: an electrical R is in Ohm, an electrical C in F, an electrical I in H. Files without units are not checked."),
    row("E0308", "domains clash", "All bonds of a junction are of one domain, and so on along the junctions. Here one element is of one domain by its unit and another, or a port, of another. Domains meet across transformers and gyrators, or couple by signals."),
    row("E0309", "ratio does not lead from one domain to the other", "A transformer has e1 = r*e2 and f2 = r*f1, so its ratio r is in the unit of e1/e2 = f2/f1; a gyrator has e1 = r*f2 and e2 = r*f1, so its r is in the unit of e1/f2 = e2/f1. `gain = …` is the inverse."),
    row("E0310", "ratio leads to no known domain", "What a two-port makes of the effort and flow of one side by its ratio are the effort and flow of no domain: electrical (V, A), rotation (N*m, rad/s), translation (N, m/s), hydraulic (Pa, m^3/s), magnetic (A, Wb/s), thermal (K, W/K), pseudo-thermal (K, W), pneumatic (Pa, kg/s)."),
    row("E0311", "pseudo domain joined to a true one", "In the pseudo domains, pseudo-thermal (K, W) and pneumatic (Pa, kg/s), effort times flow is no power, so no transformer or gyrator, which keep power, joins them to a true domain. Couple them by signals: `Sf:heat(power(R))`."),
    // -- 04: structure of the graph, causality
    row("E0401", "junction with fewer than two bonds", "A junction says what its bonds have in common, so it needs two of them at least. Draw the missing bond, or join its one neighbour to the other side directly."),
    row("E0402", "too many bonds", "A source, R, C, I or detector has one port and a two-port has two; each port takes one bond. Put a junction between: a 0-junction where the effort is common, a 1-junction where the flow is."),
    row("E0403", "bond missing", "An element needs its bond and a two-port both of them. An element that nothing joins has no effect; a two-port with one bond has nothing on its other side."),
    row("E0404", "both ends of a bond impose the same variable", "Two effort sources on one bond would set its effort twice and its flow never; so would Se with Df, two flow sources, or Sf with De."),
    row("E0405", "bond from a vertex to itself", "A bond carries power between two different ports. At a junction such a bond would say nothing."),
    row("E0406", "causal conflict", "At a 0-junction one bond brings the effort, at a 1-junction one bond brings the flow; a transformer passes each of them one way, a gyrator turns one into the other. The elements named want what these rules exclude, along the bonds named. Usually an R, C or I between them is missing in the model: two ideal voltage sources in parallel, two rigid drives on one shaft."),
    row("E0407", "causal stroke contradicts the graph", "The stroke drawn on a bond cannot stand where it does, given the sources. Leave it out and let it be assigned, or draw it at the other end."),
    row("E0408", "loop of signals", "Signals that depend on each other at the same instant have no beginning. Let the loop pass through `integ`, `lag`, `delay`, or through a bond."),
    row("E0409", "ports are not told apart", "Port 1 of a two-port is its incoming bond, port 2 its outgoing one, unless they are named: `a -> t.1`, `b -> t.2`. Two bonds of one direction must be named. The ports of a field are always named, unless it has only one; each takes one bond."),
    row("E0410", "no such port", "Two-ports have the ports .1 and .2, fields one for each row of their matrix or each of their laws; those of other elements have no names."),
    row("E0411", "port left open", "A port of a model joins exactly one bond inside and one outside; the two are one bond."),
    row("E0412", "which port?", "An instance's name alone can stand at an end of an arrow when just one of its ports has that direction; else the port is named, as in `pump.suction`."),
    row("E0413", "not a port", "Bonds join an instance at its ports. Its inner elements can be read from outside, not joined."),
    row("E0414", "half arrow against the port", "A port declares the direction of its half arrow: `port in p` is drawn `… -> m.p` outside and `p -> …` inside, `port out p` the other way round."),
    row("E0415", "two bonds at a port", "A port joins one bond on each side. Put a junction there to join more."),
    row("E0416", "two strokes on one bond", "What is drawn on the two sides of a port is one bond and has one causal stroke."),
    row("E0421", "matrix is not symmetric", "The ports of a C or I field act on each other alike: row i, column j of its matrix is row j, column i. Otherwise the field would gain or lose energy round a closed path."),
    row("E0422", "matrix is not positive definite", "A C or I field stores a positive energy whatever it stores. Its own entries, on the diagonal, are positive, and the coupling of two ports k = M/sqrt(L1*L2) lies between -1 and 1."),
    row("W0401", "derivative causality", "The storage is not free: others determine its state through junctions and two-ports without a loss between them, as two inertias on a rigid gear. It adds no state; the result is right, its initial value must agree with what determines it. A small compliance or resistance between them would make it a state, and the system stiff."),
    row("W0402", "algebraic loop", "Variables determine each other at the same instant with no storage between them, as two resistances that share a node. The solver finds their values together at each step; the result is right where the equations have one solution. A small storage at the place would break the loop, and make the system stiff."),
    row("W0403", "two-port divides by its modulus", "The graph forces a modulated transformer or gyrator into the causality in which its equations divide by the modulus: they are singular where it is 0. Give the ratio its other form (`gain =`), or put a storage or a resistance between it and what forces it."),
    row("W0404", "joined twice", "Two bonds join the same pair. Each arrow written makes a new bond; where one bond was meant, remove an arrow."),
    row("W0405", "ring of equal junctions", "Junctions of one kind joined in a ring are one junction; the flow round a ring of 0-junctions (or the effort round 1-junctions) could be anything. Leave out the bond that closes the ring."),
    row("W0406", "field does not conserve energy", "The laws of a storing field are the slopes of its stored energy: e of a port is ∂E/∂q, f of one that stores p is ∂E/∂p, each port counted into the field. So ∂e1/∂q2 = ∂e2/∂q1, and in an IC field ∂f1/∂q2 = ∂e2/∂p1. These laws differ at the point shown, so that energy is gained or lost round a closed path. Derive them from one energy; what is meant to convert power belongs into a TF or GY, what is meant to lose it into an R."),
    row("W0407", "dissipator can give power", "The power that an R field takes is f·R·f, which is negative for some flows when the symmetric part of its matrix is not positive semidefinite. An antisymmetric matrix, as a gyrator's, neither takes nor gives."),
    row("N0401", "law used the other way round", "The law of this R gives one power variable from the other, and the graph determines the one that it gives. It is kept as an implicit equation, which the solver inverts at each step; writing the law the other way round, where it can be, is faster and safer."),
    // -- 05: initial values, the graph's equations
    row("E0501", "equations cannot all hold", "Elements set the same variable to different values, so that the graph's own equations contradict each other. The message names all elements that the contradiction comes from."),
    row("E0502", "initial values contradict each other", "Storages that depend on each other (derivative causality) must satisfy their constraint at t = 0 to 1e-9; nothing is redistributed by an impulse. The message shows the stated value and the one that the others imply. Leave one of them out: it then takes the implied one."),
    row("E0503", "initial value cannot be used", "An effort or flow at the start is turned into a stored quantity by the element's law, which must have exactly one solution; and the value must be a finite number. State q0 or p0 instead."),
    row("E0504", "no values satisfy all laws at the start", "The efforts and flows at t = 0 are found from the initial values of the storages. Either they leave something open (a law without slope, a modulus of 0), or no solution was found; the message names the elements."),
    row("E0506", "a derivative is not determined", "A stored quantity is set by a signal, and the effort or flow that would move it is not free to do so. Let it act through an R, a C or an I."),
    row("W0510", "variables that nothing determines", "The junctions leave a variable open, such as the flow round a ring of 0-junctions. It is taken as 0 and cannot be observed in earnest; break the ring, or put an R into it."),
    // -- 06: translation
    row("E0601", "needed flow is undetermined", "A law, a linked source or a column needs the flow of a bond in a ring of equal junctions, and the junctions leave what runs round the ring undetermined. Leave out one bond of the ring."),
    row("E0602", "quantity is in no circuit variable", "The quantity is left undetermined by the junctions, or is no variable of its element, so that no node or current of the circuit holds it. Observe another variable."),
    row("E0603", "too many random numbers", "In a netlist `noise` is a piecewise linear source with a step for each random number until the end of the run. Hold each number for longer, or end the run earlier."),
    row("E0604", "junctions contradict a source", "Round a loop of junctions, what flows out of a 0-junction comes back to it (or what rises at a 1-junction falls again), so that nothing is left for the source: its flow, or its effort, is 0 whatever the elements are. Usually a half arrow of the loop points the wrong way, or a bond was drawn that joins what was joined already."),
    row("E0605", "dialect has no words for it", "The simulator that the netlist is asked for cannot express an element: gnucap reads linear elements only and no phase of a sine, Xyce's switches have no hysteresis, the lines of Xyce and LTspice begin at rest, and of Saber's language no sure word is known for a delay or the whole part of a number. Choose another simulator, or another model of the element."),
    row("W0601", "junctions force a variable to 0", "Round a loop of junctions, what flows out of a 0-junction comes back to it (or what rises at a 1-junction falls again), so that nothing is left for the element: its flow, or its effort, is 0 whatever its law says. Usually a half arrow of the loop points the wrong way, or a bond was drawn that joins what was joined already."),
    // -- 07: netlists and circuits
    row("E0701", "not a card", "A line of a netlist begins with the letter of a device, a dot, an asterisk or a plus sign; of the cards with a dot, the known ones are named in the manual."),
    row("E0702", "not read yet", "The card or form belongs to SPICE, but this program does not read it yet. It is an error and not a warning, since leaving it out would make another circuit."),
    row("E0703", "something is missing in a card", "The card ends, or goes on with something else, where the message says that something should stand. The help shows how such a card goes."),
    row("E0704", "something in a card is not understood", "The card holds a word too many, a key that is not read, or a bracket that is not closed."),
    row("E0705", "malformed expression", "The expression cannot be read at the place shown: an operator without operand, a bracket without its partner, a character that no expression holds."),
    row("E0706", "malformed table", "A table takes x, then pairs of plain numbers with strictly rising abscissae."),
    row("E0707", "wrong number of arguments of a waveform", "PULSE(v1 v2 td tr tf pw per), SIN(vo va freq td theta phase), EXP(v1 v2 td1 tau1 td2 tau2) and SFFM(vo va fc mdi fs) need at least their first two numbers; PWL takes pairs of a time and a value."),
    row("E0709", "block is not closed", "`.subckt` needs an `.ends`, `.control` an `.endc`, and the other way round."),
    row("E0710", "blocks nested too deeply", "Subcircuits and `.if`s stand within one another deeper than is read."),
    row("E0711", "file that includes itself", "An included file names one that is still being read, itself or one that led to it. The message shows the round."),
    row("E0712", "file outside of the folder", "`--confine DIR` allows a netlist to name files within that folder only, links followed."),
    row("E0713", "too many files", "A netlist may name ten thousand files, and have a hundred thousand of them, or 2 GiB, put in the place of its cards."),
    row("E0714", "functions without an end", "A function of `.func` calls itself, directly or through others, or the bodies put in the place of calls grow beyond all measure. Functions are put in as text is: recursion would never end."),
    row("E0715", "section is missing", "`.lib file section` takes what stands between `.lib section` and `.endl` of the file, and there is no such section."),
    row("E0731", "parameters define each other", "Each of the parameters of the round uses the next, so none has a value. The message names the round."),
    row("E0732", "value must be a number", "The value of this device may use parameters, but no voltage, current or time. Where a value follows those, write a B source."),
    row("E0733", "unknown parameter", "No `.param` and no parameter of the subcircuit has this name. Case does not matter."),
    row("E0734", "netlist without devices", "The netlist holds no card of a device. Its first line is always the title."),
    row("E0735", "name is taken", "Two devices, models or subcircuits of one scope have one name. SPICE folds case: names that differ only in case are one."),
    row("E0736", "card belongs to the top", "Analyses, options and outputs stand outside subcircuits."),
    row("E0737", "netlist is too big", "Expanded, the netlist holds more devices than this program takes."),
    row("E0738", "instance does not fit", "The subcircuit is not defined, or has another number of terminals."),
    row("E0739", "subcircuit contains itself", "The chain of instances comes back to its beginning, or is nested too deeply. The message shows the chain."),
    row("E0740", "unknown node", "A node is read at which no device stands. Nodes within instances are read as `x1.node`."),
    row("E0741", "unknown device", "A current is read of a device that does not exist. Devices within instances are read as `x1.name`."),
    row("E0742", "unknown model", "No `.model` of the needed type has this name."),
    row("E0743", "model is not understood", "The model has a parameter or a level that is not known. Diodes are of level 1, switches are `sw` and `csw`."),
    row("E0744", "waveform makes no sense", "A time is negative or runs backwards, or an argument is not finite."),
    row("E0745", "times of an analysis make no sense", "`.tran step stop [start [hmax]]` needs a step above 0 and a start before its end."),
    row("E0746", "netlist without ground", "Voltages are counted from node `0` (or `gnd`), at which some device must stand."),
    row("E0750", "value is not finite", "A device's value came out infinite or as no number, mostly from a division by 0 in a parameter. The message names the device and the value."),
    row("E0751", "coupling makes no sense", "K couples two different inductors of the same sign by -1 <= k <= 1; the mutual inductance is k*sqrt(L1*L2)."),
    row("E0752", "switch makes no sense", "A switch needs two resistances other than 0. One with a threshold closes above Vt + Vh and opens below Vt - Vh; one that goes over smoothly needs two different values to be on and off at, its hysteresis between them, and resistances above 0."),
    row("E0753", "diode makes no sense", "Is, N, Vj, BV, IBV, NBV, EG and the area of a diode are above 0, M, FC, MJSW and FCS from 0 to below 1."),
    row("E0754", "line makes no sense", "A lossless line has an impedance and a delay above 0: Z0 and TD, or F and NL with TD = NL/F."),
    row("E0755", "storage's start is not known", "A capacitor by its charge, or an inductor by its flux, with `ic=` starts at what its law gives for that voltage or current: the law must speak of nothing else, and have a value there."),
    row("E0765", "passive device without a value", "A resistor, capacitor or inductor has its value on its card or from its model: `rsh` with a length, `cj` with length and width, or the value itself."),
    row("E0766", "temperature makes no sense", "Temperatures are numbers in °C above -273.15: `.temp 27`, `.options temp=27 tnom=27`."),
    row("E0767", "delay looks ahead", "What a delay gives was there before: its time is a number not below 0, known before the run."),
    row("E0768", "LAPLACE has no equation in time", "A quotient of polynomials in s, its numerator of no higher power than its denominator, becomes differential equations, exp(-T*s) a delay. Roots of s, tables and other functions of s have no such form."),
    row("E0769", "function of frequency is not read", "FREQ and its kin give gains over frequency as tables, which have no equation in time. Give a rational function with LAPLACE."),
    row("E0770", "two laws of one storage", "`Q=` of a capacitor and `Flux=` of an inductor say all: no value, model or parameter stands beside them."),
    row("E0771", "polynomial makes no sense", "POLY(n) takes n controlling voltages or devices, then coefficients in the order 1, x, y, x*x, x*y, y*y and so on."),
    row("E0772", "pattern makes no sense", "PAT(vhi vlo td tr tf tsample b0101) takes six numbers and its bits, and behind it R=n for n repetitions, R=-1 for ever."),
    row("E0773", "arguments of a call", "The call takes another number of arguments, or points of a curve that are not numbers with rising abscissae."),
    row("E0774", "file of numbers", "A file that a curve or a PWL is read from holds pairs of a time and a value, the times rising: one pair a line, a blank or a comma between them."),
    row("E0775", "several instances make no sense", "`m=` of an X card says how many equal instances stand in parallel: a number above 0. What they take up at a node of `.global` cannot be told."),
    row("E0780", "floating node", "Nothing determines the voltage of a node, or of a group of nodes: only current sources, or nothing at all, join it to the rest of the circuit. Join it to ground by a resistor, or name one of the nodes 0."),
    row("E0781", "loop of voltage sources", "Voltage sources form a loop, so that any current could flow round it; two of them in parallel are such a loop. Put a resistance into the loop, or take one source out."),
    row("E0782", "values make no sweep", "The increment leads from the first value to the last; decades and octaves go between values of one sign; there is at least one value; frequencies are not below 0."),
    row("E0783", "table makes no sense", "`.data name p q` is followed by the values of its columns, row by row on continuation lines, and by `.enddata`; `data=name` in `.dc`, `.step` or `.ac` uses it."),
    row("E0784", "nothing to sweep", "A sweep sets a parameter of the top, a device (`r1`, `r1:r`, `x1:r1:r`), a value of a model of the top (`model:key`) or the temperature (`temp`). Nothing of these has the name."),
    row("E0785", "value cannot be swept", "The device has no value of this name that is a number: behavioural sources follow laws, switches and diodes their models. Sweep a parameter that the law uses, or `model:key`."),
    row("E0786", "not an independent source", "The input of `.tf` is a V or an I."),
    row("E0787", "pair of nodes makes no sense", "`.pz in+ in- out+ out- vol pz` takes two different nodes of the input and two of the output; the second of each is often `0`."),
    row("E0788", "nothing to take a slope by", "`.sens` takes slopes by numbers: parameters of the top, values of devices (`r1`, `r1:r`), values of a model that its card states (`model:key`), `temp`. A value that follows a voltage or the time is none."),
    row("E0789", "too many points", "A sweep has more points than this program computes: 1e8 in one analysis, 1e6 steps. The count is worked out before anything is run."),
    row("W0701", "suffix seldom meant so", "SPICE folds case: `1M` is a milli, `1F` a femto, `1A` an atto. Write `meg` for a million, and no letter for a farad or an ampere; a small letter silences the warning."),
    row("W0702", "figures after a suffix are left out", "`4k7` is read as 4k. Write 4.7k."),
    row("W0703", "card is skipped", "The card asks for something that is not computed, but says nothing of the circuit, so the run goes on without it."),
    row("W0704", "options passed over", "Xyce's `.options` come in packages that steer its own methods. Those with a meaning here are taken (`timeint reltol abstol method delmax`, `device temp tnom gmin`, `output initial_interval`), the others change nothing."),
    row("W0705", "guess at no node", "`.nodeset` names a node where no device stands. It is a hint for the operating point, so the run goes on without it."),
    row("W0730", "header line is not understood", "A comment `*bondspice key=value` is malformed and has no effect. The keys stand in the header of `netlist/header.rs`."),
    row("W0731", "node is named only once", "Nothing else stands at the node, and nothing reads it: mostly a slip of the pen, and the current into it is 0."),
    row("W0790", "measure is not taken", "Measures of `noise`, `fft` and `op`, and the forms DUTY, FREQ, ON_TIME, OFF_TIME and ERROR, are not computed. The run goes on without them."),
    row("W0791", "measure failed", "The run holds no such event, or none that often; or the window lies outside of it; or a measure that this one uses has failed. Its value is written as `failed`, and as no number in files."),
    row("W0792", "measure of another analysis", "The measure is taken from the rows of an analysis that is not the one run. `--analysis` picks that."),
    row("W0793", "no harmonics", "`.four` takes the last whole period of a transient run: this one is shorter than the period, or another analysis is run."),
    row("N0719", "dialect guessed", "Nobody said what simulator the netlist is written for, and a line of it is understood by one alone, so it is read as that one reads it: suffixes, functions, signs and names differ. `--dialect` says it."),
    // -- 08: simulation
    row("E0801", "no operating point or start", "Newton's method found no values that satisfy all equations, neither directly, nor with conductances at the nodes that are taken away step by step, nor with sources turned up step by step. The message names the equation that is satisfied worst."),
    row("E0802", "step too small", "The step became smaller than rounding allows without reaching the tolerance. A law may have a jump or a pole there, or the solution ends. The message names the equation that is satisfied worst, and why steps were cut."),
    row("E0803", "value is no number", "A law or its slope became infinite or no number. The message names the device; look for a division by 0, or a root or logarithm of a negative value."),
    row("E0804", "switches do not settle", "No combination of the switches' states agrees with the voltages that it leads to, or a switch changes to and fro at one instant. Give it more hysteresis than its own switching moves its control by, or none at all, or a capacitance at the node that controls it."),
    row("E0805", "singular equations", "At some values the equations have no single solution. The message names what is not determined."),
    row("E0806", "no transient analysis", "The run needs to know how long it is: `.tran step stop` in a netlist, `simulate until 1 s` in a bond graph."),
    row("E0807", "option makes no sense", "The value is outside what the option takes; the message says what that is."),
    row("E0808", "interrupted", "The run was interrupted. The rows written so far are good."),
    row("E0810", "steps differ in their columns", "With the values of this step the circuit has other voltages and currents than with those of the first, so that no table holds both. Name the columns with `.print`."),
    row("E0811", "nothing linear about it", "A circuit that holds samples of instants has no linear equations, and so no phasors, poles or transfer function."),
    row("E0812", "no poles or zeros", "The linearised circuit has no single solution whatever s is, or nothing of the input reaches the output, or it holds delays, whose poles have no end. The message says which."),
    row("E0813", "no slope at this value", "With the value moved a little to one side the circuit has other unknowns, so that there is no slope by it: a resistance of 0 and a capacitance of 0 are other circuits than those near by."),
    row("E0814", "no slopes over time", "Sensitivities over time follow circuits whose memory is charges and fluxes alone, and whose outputs read unknowns; switches, conditions, lines, delays and jumps of charges are not followed. The message says which."),
    row("E0816", "measure is not understood", "`.measure tran NAME` goes on with TRIG … TARG …, FIND … WHEN … or AT=, WHEN …, DERIV … AT=, one of AVG RMS MIN MAX PP INTEG MIN_AT MAX_AT with FROM= and TO=, or PARAM='…'."),
    row("E0817", "two measures of one name", "Measures of one analysis are told apart by their names. SPICE folds case."),
    row("E0818", "measure uses a later one", "A measure may use the results of those before it, in its formula and in its limits. Change the order of the cards."),
    row("E0819", "no frequency of a period", "`.four frequency v(out) …` takes the last period of the run, so the frequency is above 0 and finite."),
    row("E0850", "the second route cannot go on", "The graph's own equations, integrated without a circuit, need a step smaller than rounding allows: a law has a jump or a pole at this time, or the solution ends. The message names the variable that moves most."),
    row("E0851", "the second route cannot go on after a corner", "After a corner of a source no efforts and flows were found that satisfy all laws."),
    row("E0852", "the second route takes too many steps", "The run needs more steps than it is allowed; the laws or sources vary much faster than the run is long."),
    row("W0801", "unknown option", "No option of this name means anything here. It is ignored; the message lists those that are known."),
    row("W0803", "solution slides along a condition", "On either side of the condition the solution is led back to it at once: no side lasts, and it would change without end. The run goes on with a ramp in place of the jump, so narrow that the law takes the value between its two branches that keeps the solution there (a relay that chatters, dry friction at rest). The message says how wide. Give the law a slope of your own, or the condition some hysteresis, if the width matters."),
    row("W0804", "operating point leaves a voltage open", "Only capacitors reach the node, so that no equation of rest says its voltage. The charge on it keeps its initial value, which is 0 where nothing is said. Join it to the rest by a resistor, or state the start by `ic=` and `uic`."),
    row("W0805", "operating point leaves a current open", "Inductors, alone or with voltage sources, form a loop without resistance, so that no equation of rest says the current round it. The flux through the loop keeps its initial value, which is 0 where nothing is said. Put a resistance into the loop, or state the start by `ic=` and `uic`."),
    // -- 09: files and usage
    row("E0901", "no such file", "The file named does not exist. The message names the nearest one in the same folder."),
    row("E0902", "file cannot be read", "The system refused to read the file; its reason stands in the message."),
    row("E0903", "not a file", "A folder was named where a file is needed."),
    row("E0904", "file is too large", "Sources are limited to 1 GiB, so that places in them fit into 32 bits."),
    row("E0905", "file cannot be written", "The system refused to write the file; its reason stands in the message. Nothing is left half written: the old file, if there was one, is untouched."),
    row("E0906", "output would overwrite an input", "An output may not have the name of a file that was read. Choose another name after -o or --map."),
    row("E0907", "file exists already", "Examples are copied beside what is there, never over it. Name another folder after -o."),
    row("E0920", "not a trace", "The file is in none of the formats that traces are read from: CSV, RAW (of ngspice, Xyce, LTspice), VCD, JSON, tables of blanks."),
    row("E0921", "table cannot be read", "A table needs a header row and the same number of fields, all numbers, in each row."),
    row("E0922", "RAW file cannot be read", "The file begins as a RAW file and does not go on as one. It may have been cut off."),
    row("E0923", "JSON is no trace", "A trace in JSON is `{\"schema\": 1, \"names\": […], \"units\": […], \"columns\": [[…], …]}`, all columns of one length."),
    row("E0924", "trace has no rows", "There is a header, or nothing at all, and no row of numbers."),
    row("E0925", "two columns of one name", "Columns are told apart by their names. Give one of them another name with `as`."),
    row("E0926", "time falls", "The first column of a trace must not decrease, and must hold finite numbers."),
    row("E0927", "no linear system of finite order", "Samples of instants and delays have no linear equations with a finite number of states. Put the input of the memory in its place, or a `lag`."),
    row("E0928", "no linear model at this point", "At the point that was chosen a law has no finite slope, something is left open, or there are no poles, zeros or values to be told. The message says which. Choose another point with --at, or other variables."),
    row("E0929", "variable cannot be imposed", "Inputs of a linear model are variables: an input, a signal, an effort, a flow, a stored quantity. An expression of several cannot be imposed, a parameter neither."),
    row("E0930", "not a map of variables", "`bondspice convert --map` writes the map: JSON with `variables`, each with `bg`, `expr`, `factor` and `unit`."),
    row("E0932", "map does not fit the result", "None of the map's circuit variables has a column in the result. The map must be that of the netlist that was run."),
    row("E0933", "not a list of times", "A list of times has one time in seconds a line, rising from 0 on."),
    row("E0934", "dump cannot be read", "A value change dump declares its variables (`$var real 64 ! name $end`) after a time scale of 1, 10 or 100 s, ms, us, ns, ps or fs; then come times, `#120`, and values, `r1.5 !`, `1!`, `b0101 !`."),
    row("E0935", "format cannot hold the result", "A value change dump holds one run over time. CSV, RAW and JSON hold every result."),
    row("E0936", "no transfer function in symbols", "A transfer function in symbols is made of up to 16 states and 47 symbols, and its polynomials have bounds; it must agree with the numeric response at random points. Impose a variable nearer to what is read, so that less stands in between, or take `bondspice bode`, which has no limit."),
    row("E0937", "no point of rest", "With all sources held the model does not come to rest: something goes on moving, or the way there ends. Linearise at a time of a run instead."),
    row("E0939", "gains cannot be designed", "`bondspice tune` designs the two gains of regulators made with `pi`, for which `loop` statements say bandwidth and phase margin. The message says what is missing, or that no PI regulator can give so much margin at so high a bandwidth."),
    row("E0940", "wrong use of a flag", "The message says which flag and what it takes; `--help` shows an example."),
    row("E0941", "unknown format", "The format of a result follows from --format, else from the ending of -o: csv, raw, rawascii, ltspice, vcd, json, prn."),
    row("E0942", "nothing to compare", "No signal of the reference has a column in the trace. Pair names that differ with --signals."),
    row("E0943", "simulator or dialect that is not known", "Netlists are written for the simulators that `bondspice convert --help` lists, and read in the dialects that `bondspice simulate --help` lists."),
    row("E0944", "flag that does not fit the input", "Netlists have parameters and columns but no inputs, graph or causality; bond graphs have all of them."),
    row("E0945", "two columns of one name", "The headers of a result must differ. Give one of the columns another name with `as`."),
    row("E0948", "no such example", "`bondspice examples` lists the models that come with the program; a name stands with its folder, as in `textbook/A1`."),
    row("E0949", "no such code", "`bondspice explain` without a code lists all of them."),
    row("W0931", "result lacks variables of the map", "Some variables of the map need circuit variables that the simulator did not keep; they are left out. `.save all` keeps everything."),
    row("N0946", "one of several analyses is run", "A netlist asks for several analyses and the last is run. Pick another with --analysis."),
    row("N0947", "output interval chosen", "The file says how long to simulate and not how often to write a row: a thousand rows are written."),
    // -- 10: drawings, plots
    row("E1001", "too large to draw", "Nobody can read a picture of more than 160 junctions and elements. Draw instances as one node each with `--depth 0`, or write a `.dot` file, which Graphviz lays out at any size."),
    row("E1010", "no such column", "A column that is to be plotted has no place in any of the traces. The message names the nearest, or all there are."),
    row("E1011", "no power to tell of", "Energy is told of elements whose bonds carry power: effort times flow in watts. Temperature and heat flow, or pressure and mass flow, do not multiply to a power."),
    row("N1001", "instances are not laid open", "The whole graph has too many junctions and elements for one picture, so that instances deeper than a level are drawn as one node each. `--depth` says how deep."),
    // -- 11: models rewritten
    row("E1100", "nothing of this name to change", "`bondspice transform` and `reduce` change junctions and elements, named as in the file, those of instances with the instance's name: `valve1.flow`. The message names the nearest."),
    row("E1101", "change cannot be made", "An element, or a branch that hangs on one bond, moves over a transformer or gyrator of constant ratio when the junction that it hangs on is bonded to the two-port itself. The message says what is otherwise here."),
    row("E1102", "lines are not each other's mirror", "Two lines become one when every part of one has a mirror in the other: equal laws, linear or odd, and half arrows such that what one takes the other gives. The message names the first pair for which that is not so. Sources and check valves drive both lines alike: leave them out first, and know what that costs."),
    row("E1103", "reading has no counterpart", "After the change nothing has the value that is read here. Read a neighbour that stays, or leave the reading out."),
    row("E1104", "part cannot be left out", "An element is left out of a junction that has other bonds, where its effort (on a 1-junction) or its flow (on a 0-junction) counts as 0. What would be left must still be a model."),
    row("N1106", "instances are laid open", "The change reaches into instances of models, which others of the same model would share. So the new text holds all of them as their parts."),
    // -- 12: sweeps
    row("E1200", "plan is no TOML", "A plan of a sweep is written in TOML: `key = value` lines, tables as `[set]`, texts in quotes."),
    row("E1201", "plan says something else", "A plan has the keys model, runs, seed, set, measures, until, step, observe and options, each with values of its own kind; the message says which are meant."),
    row("E1202", "values that cannot be swept", "A parameter takes a list, a range or a distribution, both ends of one unit, once in a sweep; random values need `runs`, and nothing else does. A `.step` of a netlist is a sweep of its own."),
    row("E1203", "measure that cannot be taken", "A measure is a function of an item that can be observed, `max(x)` or `at(x, 5 ms)`; `bondspice sweep --help` lists them all."),
    row("E1204", "table of another sweep", "A sweep goes on only from a table that has its own columns and values, and parts are put together only where they are of one sweep and disjoint."),
    row("W1200", "runs failed", "Some runs of a sweep did not reach their end. Their measures are empty; the first of them is told in full."),
    row("W1201", "runs are missing", "The parts that were put together lack a run: one of them is missing or was not finished."),
];

/// Stages: the first and the last number of its codes, what it is about, and the exit code of its errors.
#[rustfmt::skip]
pub const STAGES: &[(u32, u32, &str, u8)] = &[
    (100, 199, "characters and syntax", 3),
    (200, 299, "names and language", 3),
    (300, 399, "units and domains", 3),
    (400, 499, "structure of the graph, causality", 3),
    (500, 599, "initial values, the graph's equations", 3),
    (600, 699, "translation", 3),
    (700, 799, "netlists and circuits", 3),
    (800, 899, "simulation", 4),
    (900, 919, "files", 5),
    (920, 939, "data files", 3),
    (940, 999, "usage", 2),
    (1000, 1099, "drawings and plots", 3),
    (1100, 1199, "models rewritten", 3),
    (1200, 1299, "sweeps", 3),
];

/// What the stage of a code is about.
pub fn stage(code: &str) -> Option<&'static str> {
    let number: u32 = code.get(1..)?.parse().ok()?;
    STAGES.iter().find(|row| (row.0..=row.1).contains(&number)).map(|row| row.2)
}

/// The row of a code.
pub fn find(code: &str) -> Option<&'static Code> {
    CODES.iter().find(|row| row.code == code)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The order of the table: by stage, then E, W, N, then number.
    fn key(code: &str) -> (&str, usize, &str) {
        (&code[1..3], "EWN".find(&code[..1]).unwrap(), &code[3..])
    }

    #[test]
    fn codes_are_well_formed_unique_and_sorted() {
        for row in CODES {
            assert!(row.code.len() == 5 && "EWN".contains(&row.code[..1]), "{}", row.code);
            assert!(row.code[1..].bytes().all(|b| b.is_ascii_digit()), "{}", row.code);
            assert!(stage(row.code).is_some(), "{} has no stage", row.code);
            assert!(!row.title.is_empty() && row.explanation.ends_with('.'), "{}", row.code);
        }
        for pair in CODES.windows(2) {
            assert!(
                key(pair[0].code) < key(pair[1].code),
                "{} before {}",
                pair[0].code,
                pair[1].code
            );
        }
    }
}
