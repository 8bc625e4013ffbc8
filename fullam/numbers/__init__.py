"""What a kernel computes with: floats, machine code, lanes of a vector register, or symbols.

An algorithm is written once, as a *kernel*: a plain Python function on numbers, tuples and
NamedTuples of numbers, and sequences of such records. What a number is, the caller decides:

    float                the reference: nothing is compiled, a debugger steps through it
    float64 in numba     machine code for one flight
    Lanes(8) in numba    eight flights at a time, one in each lane of a vector register
    casadi.SX            an expression: exact derivatives, and C for a flight computer

Modules, inner ones first:
    kernel            the mark `kernel`, and the primitives: select, sqrt, some, minimum, ...
    elementary        sine, cosine, arc tangent and exponential, the same bits everywhere
    vectors           3-vectors and 3 x 3 matrices as tuples of numbers
    records           NamedTuples of numbers kept in arrays: `Rows`
    lanes             the numba type of a vector register
    compiled_records  `Rows` as machine code sees them: a pointer, indexed to records
    digest            what a kernel is made of, as a key
    code_store        machine code on disk
    machine_code      kernels compiled, or loaded from disk
    compiler          the compiler, which imports numba
    random_streams    numpy's generators as kernels, bit for bit
    program           stages called in turn, period by period, by Python or by machine code

How to write a kernel:

- Arguments are numbers, tuples and NamedTuples of numbers, and sequences of records. Settings are
  numbers in a record; what is a string or an option in Python chooses between kernels outside.
- No branch on data. `select(condition, a, b)` evaluates both sides: guard a division or a root by
  a `select` of its argument. A rare and dear side goes into `if some(rare):` around such a select.
  Branches on a length or on the number of the period are the same for all flights, and are fine.
- Index tuples by constants; what has a length is a sequence, `for i in range(len(links))`.
- Loops add up in plain tuples that start as floats, and return plain tuples: a NamedTuple must hold
  lanes from the start. Storing to rows turns floats into lanes by itself.
- No fast-math and no contraction: then every lane has the bits of Python's floats, and equality is
  a test.
- `max`, `min`, `abs`, `math` and chained comparisons know nothing of lanes and expressions.
"""
