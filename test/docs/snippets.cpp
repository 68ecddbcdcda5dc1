// SPDX-License-Identifier: BSL-1.0
// The code blocks of the pages, in one file that is compiled. test/docs/code_in_docs.py looks for each of them here and
// in the examples.
#include <cles/security.hpp>
#include <cles/service.hpp>
#include <cles/setting_error.hpp>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>

#include <iostream>

namespace asio = boost::asio;
using namespace std::chrono_literals;

struct position {
    double lat = 0, lon = 0;
};
BOOST_DESCRIBE_STRUCT(position, (), (lat, lon))

struct label {
    std::string klass;
    double font_size = 12;
};
BOOST_DESCRIBE_STRUCT(label, (), (klass, font_size))
CLES_NAMES(label, (klass, "class"), (font_size, "fontSize"))
CLES_DEFAULTS(label, (font_size))

struct fix {
    double lat = 0;
    double lon = 0;
    float speed = 0;
};
BOOST_DESCRIBE_STRUCT(fix, (), (lat, lon, speed))
CLES_FIELD(fix, lat, "deg", "latitude, WGS 84", -90, 90)
CLES_FIELD(fix, lon, "deg", "longitude, WGS 84", -180, 180)
CLES_FIELD(fix, speed, "m/s")

void an_open_service();
void a_service_in_a_group();
void a_hub(asio::io_context& io);
struct own_pool {
    std::uint32_t waiting = 0;
    std::uint32_t busy = 0;
};
void the_links_of_a_node(cles::service_options& options) {
    options.gossip = cles::gossip({"tcp://10.0.2.2:25370"}, {"car1", "recon"}); // seeds, links
}

void a_load(cles::service_options& options, const own_pool& pool);
std::string plan_a_way(position there);
void record_camera(const cles::request& asked);
void a_task_to_repeat(cles::registrar& tasks);
void handlers(cles::service& car, position& target, std::array<double, 4>& tyres);
asio::awaitable<void> asking(cles::service& car);
asio::awaitable<void> finding(asio::io_context& io);
asio::awaitable<void> errors(cles::service& car);
asio::awaitable<void> feeds(cles::service& car);
void blocking(cles::service& me);
asio::awaitable<double> drive_to(position where);
double pressure_of(const cles::request& asked);
void follow(const position& where);
void slow_down(const std::string& why);

void a_secured_service() {
    asio::io_context io;
    cles::service secured{
        io, {.name = "car1", .listen = {"tls://0.0.0.0:0"}, .security = cles::secured("/var/lib/cles/keys")}};
}

void an_open_service() {
    asio::io_context io;
    cles::service open{io, {.name = "car1", .listen = {"tcp://0.0.0.0:0"}, .insecure = true}};
    cles::service fast{io, {.name = "car2", .listen = {"udp://127.0.0.1:0"}, .networks = {"10.0.0.0/8", "fd00::/8"}}};
}

void handlers(cles::service& car, position& target, std::array<double, 4>& tyres) {
    car.on_pull("tyre", [&](const cles::request& asked) { return tyres.at(asked.parameter<std::size_t>(0)); });
    car.on_push("target", [&](const position& to) { target = to; });
    car.on_delegate("park", [&](cles::request, position where) -> asio::awaitable<double> {
        const double metres = co_await drive_to(where);
        co_return metres;
    });
    car.on_pull("tyre", pressure_of, {.description = "Pressure in bar", .parameters = {"which"}, .idempotent = true});
}

asio::awaitable<void> asking(cles::service& car) {
    const auto where = co_await car.async_pull<position>("car0:position");
    co_await car.async_push("car0:target", where);
    const auto metres = co_await car.async_delegate<double>("car0:park", where, cles::call_options{}.deadline(20s));
    const auto answer = co_await car.async_request("PULL car0:tyre/2"); // JSON, as text
    std::cout << metres << answer.text;
}

asio::awaitable<void> finding(asio::io_context& io) {
    cles::service radar{io, {.name = "radar", .listen = {"tcp://127.0.0.1:0"}, .multicast = {.interface = "lo"}}};
    const auto speed = co_await radar.async_pull<double>("car0:speed"); // wherever car0 is
    for (const auto& other : radar.peers()) {
        std::cout << other.node << ' ' << to_string(other.state) << '\n';
    }
    std::cout << speed;
}

asio::awaitable<void> errors(cles::service& car) {
    try {
        co_await car.async_pull<double>("car0:altitude");
    } catch (const cles::error& failure) {
        if (failure.code() == cles::errc::no_task) {
            std::cerr << failure.message() << '\n'; // car0 has no PULL 'altitude'
        }
    }
}

asio::awaitable<void> feeds(cles::service& car) {
    auto feed = co_await car.async_bind<position>("car0:position", cles::bind_options{}.every(100ms));
    for (;;) {
        const auto event = co_await feed.async_next();
        if (event.has_value()) {
            follow(event.value);
        } else if (event.kind == cles::feed_event::lost) {
            slow_down(event.text);
        }
    }
}

void a_hub(asio::io_context& io) {
    cles::service hub{io, {.name = "hub", .listen = {"tcp://127.0.0.1:25370"}, .routing = cles::routing()}};
    hub.set_peer("car1", "tcp://127.0.0.1:25371");
}

void a_load(cles::service_options& options, const own_pool& pool) {
    options.load = [&pool] {
        return cles::node_load{.queued = pool.waiting, .running = pool.busy, .workers = 4, .service_us = 1'500};
    };
}

void a_task_to_repeat(cles::registrar& tasks) {
    tasks.on_delegate("plan", plan_a_way, {.description = "A way there", .idempotent = true});
}

void a_task_that_stays(cles::registrar& tasks) {
    tasks.on_delegate("record", record_camera, {.description = "Records the camera", .local = true});
}

void blocking(cles::service& me) {
    const std::string json = me.request("PULL car:speed");
    std::cout << json;
}

namespace checked {

struct settings {
    std::optional<double> rate;

    void check() const {
        if (rate.value_or(1) > 60) {
            throw cles::setting_error("rate", "60 at most");
        }
    }
};

} // namespace checked
