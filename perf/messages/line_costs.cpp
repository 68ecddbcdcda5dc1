// SPDX-License-Identifier: BSL-1.0
#include "line_costs.hpp"

#include "perf/baseline/packet.hpp"
#include "perf/support/localization.hpp"

#include <chrono>
#include <cstring>
#include <stdexcept>
#include <string_view>

namespace cles::perf {
namespace {

using clock = std::chrono::steady_clock;

constexpr std::string_view expected_reply = "id=1 {}\n";

double nanoseconds(clock::duration span) { return static_cast<double>(std::chrono::nanoseconds{span}.count()); }

/// `{"samples":[...]}` of this number of bytes, or a few less.
std::string series_text(std::size_t bytes) {
    constexpr std::string_view end = "]}";
    std::string text = R"({"samples":[)";
    for (std::uint64_t i = 0;; ++i) {
        const auto number = to_json(sample(i).lat);
        if (text.size() + number.size() + 1 + end.size() > bytes) {
            break;
        }
        text.append(i == 0 ? "" : ",").append(number);
    }
    return text.append(end);
}

/// The same numbers in a packed struct: a type and a length of 4 bytes each, and the numbers, in network order.
std::vector<std::byte> pack(const series& values) {
    std::vector<std::byte> packed(8 + 8 * values.samples.size());
    const std::uint32_t head[2] = {htobe32(icd::reply_type), htobe32(static_cast<std::uint32_t>(packed.size()))};
    std::memcpy(packed.data(), head, sizeof head);
    for (std::size_t i = 0; i < values.samples.size(); ++i) {
        const auto bits = icd::to_network(values.samples[i]);
        std::memcpy(packed.data() + 8 + 8 * i, &bits, sizeof bits);
    }
    return packed;
}

bool unpack(const std::vector<std::byte>& packed, series& values) {
    std::uint32_t head[2];
    std::memcpy(head, packed.data(), sizeof head);
    if (be32toh(head[0]) != icd::reply_type || be32toh(head[1]) != packed.size()) {
        return false;
    }
    values.samples.resize((packed.size() - sizeof head) / 8);
    for (std::size_t i = 0; i < values.samples.size(); ++i) {
        std::uint64_t bits = 0;
        std::memcpy(&bits, packed.data() + sizeof head + 8 * i, sizeof bits);
        values.samples[i] = icd::from_network(bits);
    }
    return true;
}

/// Into a new vector each time, as the library does.
double time_packed(const std::vector<std::byte>& packed, std::uint64_t repetitions) {
    const auto began = clock::now();
    for (std::uint64_t i = 0; i < repetitions; ++i) {
        series values;
        if (!unpack(packed, values)) {
            throw std::runtime_error("the packed struct cannot be read");
        }
        asm volatile("" : : "r"(values.samples.data()) : "memory"); // otherwise the compiler would optimise it away
    }
    return nanoseconds(clock::now() - began) / static_cast<double>(repetitions);
}

} // namespace

line_costs::line_costs()
    : car_(io_, {.name = "car1", .listen = {direct_exchange::url}}),
      client_(io_, {.name = "bench", .peers = {{"car1", direct_exchange::url}}}) {
    car_.on_pull("nothing", [] {});
    car_.on_push("text", [](const request&) {});
    car_.on_push("series", [this](const series& values) { read_ = values.samples.size(); });
    into_car_ = exchange_.call();
}

line_costs::~line_costs() = default;

line_times line_costs::measure(std::size_t bytes, std::uint64_t repetitions) {
    // An adverb that no node knows, but every node has to parse.
    std::string head = "PULL car1:nothing id=1 pad=";
    head.append(bytes - head.size(), 'x');
    const std::string text = "PUSH car1:text id=1 ";
    const std::string typed = "PUSH car1:series id=1 ";
    const auto body = series_text(bytes - typed.size());
    const auto values = from_json<series>(body);
    const auto packed = pack(values);

    line_times times{.packed_size = packed.size()};
    times.head = time_request(head, repetitions);
    times.validated = time_request(text + body, repetitions);
    times.typed = time_request(typed + body, repetitions);
    if (read_ != values.samples.size()) {
        throw std::runtime_error("the handler did not get the numbers that were sent");
    }
    times.reply_validated = time_reply<json_text>(body, repetitions);
    times.reply_typed = time_reply<series>(body, repetitions);
    times.packed = time_packed(packed, repetitions);
    return times;
}

double line_costs::time_request(const std::string& line, std::uint64_t repetitions) {
    const auto began = clock::now();
    for (std::uint64_t i = 0; i < repetitions; ++i) {
        into_car_->deliver(line);
        if (into_car_->written() != expected_reply) {
            throw std::runtime_error("a request was answered with " + into_car_->written());
        }
    }
    const auto took = clock::now() - began;
    io_.restart();
    io_.poll();
    return nanoseconds(took) / static_cast<double>(repetitions);
}

template <class T>
double line_costs::time_reply(const std::string& body, std::uint64_t repetitions) {
    clock::duration took{};
    std::string reply;
    for (std::uint64_t i = 0; i < repetitions; ++i) {
        bool came = false;
        client_.async_pull<T>("car1:series", [&](boost::system::error_code code, const T&) { came = !code; });
        io_.restart();
        io_.poll(); // sends the request; the first time this creates the link
        const auto& asked = exchange_.dialled()->written();
        const auto id = asked.find("id=");
        reply.assign(asked, id, asked.find_first_of(" \n", id) - id).append(" ").append(body);

        const auto began = clock::now();
        exchange_.dialled()->deliver(reply);
        took += clock::now() - began;
        if (!came) {
            throw std::runtime_error("a reply was not delivered");
        }
    }
    return nanoseconds(took) / static_cast<double>(repetitions);
}

} // namespace cles::perf
