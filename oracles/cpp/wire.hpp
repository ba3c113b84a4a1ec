// The wire protocol of oracles/PROTOCOL.md for C++17 on a little-endian POSIX system: the only file of ours that a C++ oracle includes.
//
//     wire::Job prepare(const std::string& stage, const wire::Message& inputs) {
//         auto& t = wire::f64(inputs, "t", 1);                // inputs have lost their "in."
//         ...                                                 // conversions that are not the stage's own work
//         return {[=] { work(); },                            // only this is timed
//                 [=] { return wire::Message{{"u", wire::Array{{n}, values}}}; }};  // outputs, without their "out."
//     }
//     int main() { return wire::serve("library 1.2", prepare); }
//
// Throw wire::Unsupported where the library has not got the stage for these inputs; any other std::exception becomes "error".

#pragma once

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace wire {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the protocol is little-endian");

struct Unsupported : std::runtime_error {
    using std::runtime_error::runtime_error;
};

// A stream that is no longer at the start of a message: nothing after it can be understood.
struct Malformed : std::runtime_error {
    using std::runtime_error::runtime_error;
};

using Reals = std::vector<double>;
using Integers = std::vector<std::int64_t>;

struct Array {
    std::vector<std::uint64_t> shape;
    std::variant<Reals, Integers, std::string> data;  // row-major; in the order of the dtypes 1, 2, 3
};

using Message = std::map<std::string, Array>;

struct Job {
    std::function<void()> work;
    std::function<Message()> answer;
};

inline Array text(const std::string& value) { return {{value.size()}, value}; }

template <class T>
const T& get(const Message& message, const std::string& name, std::size_t rank) {
    const auto found = message.find(name);
    if (found == message.end()) throw std::invalid_argument("no record " + name);
    const T* data = std::get_if<T>(&found->second.data);
    if (!data) throw std::invalid_argument(name + " has the wrong dtype");
    if (found->second.shape.size() != rank) throw std::invalid_argument(name + " has the wrong rank");
    return *data;
}

inline const Reals& f64(const Message& message, const std::string& name, std::size_t rank) {
    const Reals& data = get<Reals>(message, name, rank);
    for (double x : data)
        if (!std::isfinite(x)) throw std::invalid_argument(name + " is not finite");
    return data;
}

inline const Integers& i64(const Message& message, const std::string& name, std::size_t rank) {
    return get<Integers>(message, name, rank);
}

inline std::int64_t scalar(const Message& message, const std::string& name) { return i64(message, name, 0)[0]; }

inline const std::string& text(const Message& message, const std::string& name) { return get<std::string>(message, name, 1); }

namespace detail {

inline void read_bytes(std::FILE* in, void* to, std::size_t count) {
    if (std::fread(to, 1, count, in) != count) throw Malformed("the stream ends inside a message");
}

template <class T>
T read_number(std::FILE* in) {
    T value;
    read_bytes(in, &value, sizeof value);
    return value;
}

// Grows with the bytes that arrive, so that a size which is a lie costs no memory.
template <class Data>
Data read_elements(std::FILE* in, std::uint64_t count) {
    constexpr std::uint64_t chunk = 1 << 20;
    Data data;
    while (data.size() < count) {
        const std::size_t start = data.size();
        data.resize(start + std::min(chunk, count - start));
        read_bytes(in, &data[start], (data.size() - start) * sizeof data[0]);
    }
    return data;
}

inline std::uint64_t product(const std::vector<std::uint64_t>& shape) {
    if (std::find(shape.begin(), shape.end(), 0) != shape.end()) return 0;
    std::uint64_t count = 1;
    for (std::uint64_t extent : shape) {
        if (extent > std::numeric_limits<std::uint64_t>::max() / 8 / count) throw Malformed("a record of absurd size");
        count *= extent;
    }
    return count;
}

// The next message, or false at the end of the stream.
inline bool read_message(std::FILE* in, Message& message) {
    char magic[4];
    const std::size_t found = std::fread(magic, 1, 4, in);
    if (found == 0) return false;
    if (found != 4 || std::memcmp(magic, "MSEQ", 4) != 0) throw Malformed("not a message");
    message.clear();
    for (auto records = read_number<std::uint32_t>(in); records > 0; --records) {
        const std::string name = read_elements<std::string>(in, read_number<std::uint16_t>(in));
        const auto dtype = read_number<std::uint8_t>(in);
        Array array;
        array.shape = read_elements<std::vector<std::uint64_t>>(in, read_number<std::uint8_t>(in));
        const std::uint64_t count = product(array.shape);
        if (dtype == 1) array.data = read_elements<Reals>(in, count);
        else if (dtype == 2) array.data = read_elements<Integers>(in, count);
        else if (dtype == 3) array.data = read_elements<std::string>(in, count);
        else throw Malformed("no such dtype: " + std::to_string(dtype));
        if (!message.emplace(name, std::move(array)).second) throw Malformed("two records are named " + name);
    }
    return true;
}

template <class T>
void append(std::string& bytes, const T* values, std::size_t count) {
    bytes.append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

template <class T>
void append(std::string& bytes, T value) {
    append(bytes, &value, 1);
}

inline bool write_message(std::FILE* out, const Message& message) {
    std::string bytes = "MSEQ";
    append(bytes, static_cast<std::uint32_t>(message.size()));
    for (const auto& [name, array] : message) {
        append(bytes, static_cast<std::uint16_t>(name.size()));
        bytes += name;
        append(bytes, static_cast<std::uint8_t>(array.data.index() + 1));
        append(bytes, static_cast<std::uint8_t>(array.shape.size()));
        append(bytes, array.shape.data(), array.shape.size());
        std::visit([&](const auto& data) { append(bytes, data.data(), data.size()); }, array.data);
    }
    return std::fwrite(bytes.data(), 1, bytes.size(), out) == bytes.size() && std::fflush(out) == 0;
}

// `why` may repeat bytes of the request; what is not ASCII in it might not be UTF-8 either.
inline Message refusal(const char* status, std::string why) {
    std::replace_if(why.begin(), why.end(), [](unsigned char c) { return c > 126; }, '?');
    return {{"status", text(status)}, {"message", text(why)}};
}

using Prepare = std::function<Job(const std::string&, const Message&)>;

inline Message run(const Prepare& prepare, const Message& request) {
    Message inputs;
    for (const auto& [name, array] : request)
        if (name.compare(0, 3, "in.") == 0) inputs.emplace(name.substr(3), array);
    const std::int64_t samples = scalar(request, "samples"), batch = scalar(request, "batch");
    if (samples < 1 || batch < 1) throw std::invalid_argument("samples and batch start at 1");

    const Job job = prepare(text(request, "stage"), inputs);
    Reals seconds;
    for (std::int64_t sample = 0; sample < samples; ++sample) {
        const auto start = std::chrono::steady_clock::now();
        for (std::int64_t call = 0; call < batch; ++call) job.work();
        const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
        seconds.push_back(elapsed.count() / static_cast<double>(batch));
    }

    Message reply{{"status", text("ok")}, {"seconds", {{seconds.size()}, seconds}}};
    for (auto& [name, array] : job.answer()) {
        if (std::holds_alternative<Reals>(array.data))
            for (double x : std::get<Reals>(array.data))
                if (!std::isfinite(x)) throw std::runtime_error("the answer's " + name + " is not finite");
        reply.emplace("out." + name, array);
    }
    return reply;
}

inline Message answer(const std::string& version, const Prepare& prepare, const Message& request) {
    try {
        const std::string& op = text(request, "op");
        if (op == "version") return {{"status", text("ok")}, {"version", text(version)}};
        if (op != "run") throw std::invalid_argument("no such op: " + op);
        return run(prepare, request);
    } catch (const Unsupported& reason) {
        return refusal("unsupported", reason.what());
    } catch (const std::exception& error) {
        return refusal("error", error.what());
    }
}

}  // namespace detail

// Answers requests until standard input closes; the result is main's. What a library prints goes to standard error.
inline int serve(const std::string& version, const detail::Prepare& prepare) {
    std::signal(SIGPIPE, SIG_IGN);
    std::FILE* out = fdopen(dup(1), "wb");
    if (!out || dup2(2, 1) < 0) return 1;
    try {
        Message request;
        while (detail::read_message(stdin, request))
            if (!detail::write_message(out, detail::answer(version, prepare, request))) return 1;
        return 0;
    } catch (const std::exception& error) {  // Malformed, or memory ran out: the place in the stream is lost
        detail::write_message(out, detail::refusal("error", error.what()));
        return 1;
    }
}

}  // namespace wire
