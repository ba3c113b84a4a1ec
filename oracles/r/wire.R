# The wire protocol of oracles/PROTOCOL.md for base R: the only file of ours that an R oracle sources.
#
#     prepare <- function(stage, inputs) {       # inputs: list of vectors and arrays, scalars of length one, text as character
#         t <- record(inputs, "t")               # an error where there is none; `$` would take a longer name for it
#         function() list(values = ...)          # only this is timed; its list holds the outputs
#     }
#     serve("stats 4.2.2", prepare)
#
# unsupported("why") says that R has not got the stage for these inputs; any other stop() becomes "error".
#
# R has no 64-bit integer: an i64 is read as two 32-bit words and put together in a double, exact up to 2^53. On the way out
# an R integer vector becomes i64, a double f64, a character string u8, a matrix keeps its shape, a vector has rank 1.
# R has no fine monotonic clock: proc.time() counts milliseconds, so Sys.time() it is, which has about 0.2 microseconds but
# follows the system's clock. A sample that comes out as no time at all, or less, is taken again.
# R cannot redirect file descriptors: messages go through `cat`, which holds the true standard output, and sink() sends
# whatever R code prints to standard error.

unsupported <- function(why) stop(structure(class = c("unsupported", "error", "condition"), list(message = why, call = NULL)))

record <- function(records, name) if (is.null(records[[name]])) stop("no record ", name) else records[[name]]

# In chunks, so that a size which is a lie costs no memory.
read_elements <- function(stream, what, count, size, signed = TRUE) {
    chunks <- list()
    while (count > 0) {
        wanted <- min(count, 2^20)
        chunk <- readBin(stream, what, wanted, size, signed, endian = "little")
        if (length(chunk) < wanted) stop("the stream ends inside a message")
        chunks[[length(chunks) + 1]] <- chunk
        count <- count - wanted
    }
    if (length(chunks)) unlist(chunks) else vector(what, 0)
}

# readBin takes the bits of -2^31 for NA.
unsigned <- function(words) ifelse(is.na(words), 2^31, words %% 2^32)

read_i64 <- function(stream, count) {
    words <- matrix(read_elements(stream, "integer", 2 * count, 4), nrow = 2)
    ifelse(is.na(words[2, ]), -2^31, words[2, ]) * 2^32 + unsigned(words[1, ])
}

# From row-major, as the protocol has it, to R's column-major.
shaped <- function(values, shape) if (length(shape) < 2) values else aperm(array(values, rev(shape)))

read_record <- function(stream) {
    name <- rawToChar(read_elements(stream, "raw", read_elements(stream, "integer", 1, 2, signed = FALSE), 1))
    header <- read_elements(stream, "integer", 2, 1, signed = FALSE)
    shape <- read_i64(stream, header[2])
    if (any(shape < 0)) stop("a record of absurd size")
    count <- prod(shape)
    values <- switch(header[1],
        read_elements(stream, "double", count, 8),
        read_i64(stream, count),
        rawToChar(read_elements(stream, "raw", count, 1)))
    if (is.null(values)) stop("no such dtype: ", header[1])
    list(name = name, value = if (is.character(values)) values else shaped(values, shape))
}

# The next message as a list, or NULL at the end of the stream.
read_message <- function(stream) {
    magic <- readBin(stream, "raw", 4)
    if (length(magic) == 0) return(NULL)
    if (!identical(magic, charToRaw("MSEQ"))) stop("not a message")
    message <- list()
    for (i in seq_len(unsigned(read_elements(stream, "integer", 1, 4)))) {
        found <- read_record(stream)
        if (found$name %in% names(message)) stop("two records have one name")
        message[[found$name]] <- found$value
    }
    message
}

write_record <- function(stream, name, value) {
    integers <- function(values, size) writeBin(as.integer(values), stream, size, endian = "little")
    shape <- if (is.character(value)) nchar(value, "bytes") else if (is.null(dim(value))) length(value) else dim(value)
    integers(nchar(name, "bytes"), 2)
    writeBin(charToRaw(name), stream)
    integers(c(if (is.character(value)) 3 else if (is.integer(value)) 2 else 1, length(shape)), 1)
    integers(rbind(shape, 0), 4)
    if (is.character(value)) return(writeBin(charToRaw(value), stream))
    if (is.array(value)) value <- aperm(value)
    if (is.integer(value)) integers(rbind(as.vector(value), -(as.vector(value) < 0)), 4)
    else writeBin(as.vector(value), stream, 8, endian = "little")
}

write_message <- function(stream, message) {
    writeBin(charToRaw("MSEQ"), stream)
    writeBin(length(message), stream, 4, endian = "little")
    for (name in names(message)) write_record(stream, name, message[[name]])
    flush(stream)
}

run <- function(prepare, request) {
    inputs <- request[startsWith(names(request), "in.")]
    names(inputs) <- substring(names(inputs), 4)
    samples <- record(request, "samples")
    batch <- record(request, "batch")
    if (samples < 1 || batch < 1) stop("samples and batch start at 1")
    call <- prepare(record(request, "stage"), inputs)
    seconds <- numeric(0)
    while (length(seconds) < samples) {
        start <- Sys.time()
        for (i in seq_len(batch)) outputs <- call()
        elapsed <- as.numeric(difftime(Sys.time(), start, units = "secs"))
        if (elapsed > 0) seconds <- c(seconds, elapsed / batch)
    }
    if (!all(is.finite(unlist(outputs)))) stop("the answer is not finite")
    names(outputs) <- paste0("out.", names(outputs))
    c(list(status = "ok", seconds = seconds), outputs)
}

answer <- function(version, prepare, request) tryCatch(
    switch(record(request, "op"),
        version = list(status = "ok", version = version),
        run = run(prepare, request),
        stop("no such op")),
    unsupported = function(reason) list(status = "unsupported", message = conditionMessage(reason)),
    error = function(reason) list(status = "error", message = conditionMessage(reason)))

# Answers requests until standard input closes.
serve <- function(version, prepare) {
    stream_in <- file("stdin", "rb")
    stream_out <- pipe("cat", "wb")
    sink(stderr())
    lost <- tryCatch({
        while (!is.null(request <- read_message(stream_in))) write_message(stream_out, answer(version, prepare, request))
        FALSE
    }, error = function(reason) {
        write_message(stream_out, list(status = "error", message = conditionMessage(reason)))
        TRUE
    })
    close(stream_out)
    quit(save = "no", status = as.integer(lost))
}
