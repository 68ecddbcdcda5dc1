// SPDX-License-Identifier: BSL-1.0
#include "wire_bytes.hpp"

#include <cles/service.hpp>

#include "byte_tap.hpp"
#include "datagram_tap.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>

#include <exception>

namespace cles::perf {

namespace asio = boost::asio;

namespace {

constexpr const char* noun = "car1:localization";

void register_all(service& car, packet_source packets) {
    car.on_pull("localization", [packets, served = std::uint64_t{0}]() mutable { return packets(served++); });
    car.on_push("localization", [](const localization&) {});
    car.on_delegate("localization", [](const localization& value) { return value; });
    car.on_update("localization", [](const localization&) {});
}

/// Counts the bytes between two points in time.
template <class Tap>
class meter {
  public:
    explicit meter(const Tap& tap) : tap_(tap), to_server_(tap.to_server()), to_client_(tap.to_client()) {}

    [[nodiscard]] exchange_bytes mean(std::uint64_t exchanges) const {
        const auto count = static_cast<double>(exchanges);
        return {.request = static_cast<double>(tap_.to_server() - to_server_) / count,
                .reply = static_cast<double>(tap_.to_client() - to_client_) / count};
    }

  private:
    const Tap& tap_;
    std::uint64_t to_server_;
    std::uint64_t to_client_;
};

template <class Tap>
asio::awaitable<void> measure(service& car, service& client, const Tap& tap, std::uint64_t exchanges,
                              packet_source packets, verb_bytes& out) {
    // The first request waits for the link. If that takes a millisecond, it has a `deadline=`, which would count.
    co_await client.async_pull<localization>(noun);

    const meter pulls{tap};
    for (std::uint64_t i = 0; i < exchanges; ++i) {
        co_await client.async_pull<localization>(noun);
    }
    out.pull = pulls.mean(exchanges);

    const meter pushes{tap};
    for (std::uint64_t i = 0; i < exchanges; ++i) {
        co_await client.async_push(noun, packets(i));
    }
    out.push = pushes.mean(exchanges);

    const meter delegates{tap};
    for (std::uint64_t i = 0; i < exchanges; ++i) {
        co_await client.async_delegate<localization>(noun, packets(i));
    }
    out.delegate = delegates.mean(exchanges);

    const meter asks{tap};
    for (std::uint64_t i = 0; i < exchanges; ++i) {
        co_await client.async_request("UPDATE " + std::string{noun} + " " + to_json(packets(i)));
    }
    out.ask = asks.mean(exchanges);

    const meter binds{tap};
    auto feed = co_await client.async_bind<localization>(noun);
    out.bind = binds.mean(1);

    const auto current = co_await feed.async_next();
    if (current.kind != feed_event::current) {
        throw error(errc::failed, "the reply to BIND does not contain a packet");
    }
    const meter updates{tap};
    for (std::uint64_t i = 0; i < exchanges; ++i) {
        car.update("localization", packets(i));
        const auto item = co_await feed.async_next();
        if (item.kind != feed_event::update || item.value != packets(i)) {
            throw error(errc::failed, "an update was lost");
        }
    }
    out.update = updates.mean(exchanges).reply;
}

template <class Tap>
verb_bytes measure_by(const std::string& url, std::uint64_t exchanges, packet_source packets) {
    asio::io_context io{1};
    service car{io, {.name = "car1", .listen = {url}}};
    register_all(car, packets);
    const Tap tap{parse_url(car.endpoints().front())};
    service client{io, {.name = "bench", .peers = {{"car1", tap.url()}}}};
    verb_bytes out;
    std::exception_ptr failure;
    asio::co_spawn(io, measure(car, client, tap, exchanges, packets, out), [&](std::exception_ptr thrown) {
        failure = std::move(thrown);
        io.stop();
    });
    io.run();
    client.stop();
    car.stop();
    if (failure) {
        std::rethrow_exception(failure);
    }
    return out;
}

} // namespace

verb_bytes measure_bytes(const std::string& scheme, std::uint64_t exchanges, packet_source packets) {
    return scheme == "udp" ? measure_by<datagram_tap>("udp://127.0.0.1:0", exchanges, packets)
                           : measure_by<byte_tap>("tcp://127.0.0.1:0", exchanges, packets);
}

} // namespace cles::perf
