// SPDX-License-Identifier: BSL-1.0
// A program's own functions have the names of ours, in the namespace of its types, where argument-dependent lookup
// finds them. The library calls none of them.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/describe.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <exception>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <variant>
#include <vector>

// -- a program with functions of its own ---------------------------------------------------------------------------

namespace hostile {

int calls = 0;

enum class gear { park, drive };
BOOST_DESCRIBE_ENUM(gear, park, drive)

// Everything is equal to everything.
inline bool operator==(gear, gear) {
    ++calls;
    return true;
}

struct point {
    double lat = 0;
    gear in = gear::park;

    point* operator&() { // NOLINT(google-runtime-operator): it is hostile
        ++calls;
        return nullptr;
    }
};
BOOST_DESCRIBE_STRUCT(point, (), (lat, in))

struct all_of_it {
    point one;
    std::vector<point> many;
    std::array<point, 1> fixed;
    std::map<std::string, point> named;
    std::unordered_map<std::string, point> hashed;
    std::pair<point, int> two;
    std::tuple<point> three;
    std::optional<point> maybe;
    std::variant<std::monostate, point> either;
};
BOOST_DESCRIBE_STRUCT(all_of_it, (), (one, many, fixed, named, hashed, two, three, maybe, either))

// The same names as the library's functions: for these types, and as templates that fit any arguments better than ours.
inline std::string to_json(const point&) {
    ++calls;
    return "<point>\n";
}
inline std::string to_json(const all_of_it&) {
    ++calls;
    return "<all>";
}
template <class... A>
bool from_json(A&&...) {
    ++calls;
    return true;
}
template <class Writer>
void write_json(Writer&, const point&) {
    ++calls;
}
template <class Reader, class T>
bool read_json(Reader&, T&) {
    ++calls;
    return true;
}

#define HOSTILE(name)                                                                                                  \
    template <class... A>                                                                                              \
    int name(A&&...) {                                                                                                 \
        return ++calls;                                                                                                \
    }
HOSTILE(begin)
HOSTILE(end)
HOSTILE(size)
HOSTILE(data)
HOSTILE(move)
HOSTILE(forward)
HOSTILE(exchange)
HOSTILE(fill)
HOSTILE(copyable)
HOSTILE(invoke_handler)
HOSTILE(make_operation)
HOSTILE(end_operation)
HOSTILE(free_operation)
HOSTILE(discard_operation)
HOSTILE(release_slot)
HOSTILE(connect_slot)
HOSTILE(make_call)
HOSTILE(start_next)
HOSTILE(fail_later)
HOSTILE(about_to_start)
HOSTILE(read_body)
HOSTILE(read_result)
HOSTILE(read_shared_body)
HOSTILE(read_elements)
HOSTILE(read_members)
HOSTILE(write_members)
HOSTILE(write_field)
HOSTILE(write_fields)
HOSTILE(class_of)
HOSTILE(table_of)
HOSTILE(any_is_named)
HOSTILE(visit)
HOSTILE(apply)
#undef HOSTILE

template <class T>
void swap(T&, T&) {
    ++calls;
}
template <std::size_t I, class T>
int get(T&&) {
    return ++calls;
}
template <class T>
int get(T&&) {
    return ++calls;
}

all_of_it everything() {
    const point p{1.5, gear::drive};
    return {.one = p,
            .many = {p},
            .fixed = {p},
            .named = {{"a", p}},
            .hashed = {{"b", p}},
            .two = {p, 2},
            .three = {p},
            .maybe = p,
            .either = p};
}

// Handlers of that namespace.
struct handlers {
    struct pull {
        all_of_it operator()() const { return everything(); }
    };
    struct push {
        all_of_it operator()(const all_of_it& body) const { return body; }
    };
    struct later {
        void operator()(const cles::request& r, const cles::responder& to) const {
            to.progress(0.5, r.as<all_of_it>());
            to.done(r.as<all_of_it>());
        }
    };
    struct coroutine {
        boost::asio::awaitable<all_of_it> operator()(all_of_it body) const { co_return body; }
    };
};
struct taker {
    cles::test::answer<all_of_it>* to;
    void operator()(boost::system::error_code code, all_of_it value) const {
        ++to->calls;
        to->code = code;
        to->value = std::move(value);
    }
};

} // namespace hostile

BOOST_AUTO_TEST_SUITE(hostile_names)

namespace {

using namespace cles::test;
using hostile::all_of_it;
using hostile::everything;
using hostile::point;

const std::string text = R"({"lat":1.5,"in":"drive"})";
const std::string whole = "{\"one\":" + text + ",\"many\":[" + text + "],\"fixed\":[" + text +
                          "],\"named\":{\"a\":" + text + "},\"hashed\":{\"b\":" + text + "},\"two\":[" + text +
                          ",2],\"three\":[" + text + "],\"maybe\":" + text + ",\"either\":" + text + "}";

std::string converted(const all_of_it& value) { return cles::to_json(value); }

struct nodes {
    nodes() {
        hostile::calls = 0;
        car.on_pull("all", hostile::handlers::pull{});
        car.on_push("all", hostile::handlers::push{});
        car.on_delegate("all", hostile::handlers::later{});
        car.on_delegate("soon", hostile::handlers::coroutine{});
        car.on_pull("point", [] { return point{1.5, hostile::gear::drive}; });
        car.on_pull("gear", [] { return hostile::gear::drive; });
        car.on_push("text", [this](const cles::json_text& said) { pushed = said.text; });
        car.on_bind("noun");
    }
    ~nodes() { BOOST_TEST(hostile::calls == 0); }

    boost::asio::io_context io;
    std::string pushed;
    cles::service car{io, listening("car1")};
    cles::service user{io, knowing("user", car)};
};

} // namespace

BOOST_FIXTURE_TEST_CASE(results_and_bodies_are_converted_by_the_library, nodes) {
    answer<all_of_it> got[5];
    std::string progress;
    user.async_pull<all_of_it>("car1:all", hostile::taker{&got[0]});
    user.async_push<all_of_it>("car1:all", everything(), hostile::taker{&got[1]});
    user.async_delegate<all_of_it>(
        "car1:all", everything(),
        cles::call_options{}.on_progress([&](double, std::string_view details) { progress = details; }),
        hostile::taker{&got[2]});
    user.async_delegate<all_of_it>("car1:soon", everything(), hostile::taker{&got[3]});
    user.async_push<all_of_it>("car1:all", cles::json_text{whole}, hostile::taker{&got[4]});
    for (auto& each : got) {
        run_until(io, [&] { return each.done(); });
        BOOST_TEST(!each.code);
        BOOST_TEST(converted(each.value) == whole);
    }
    BOOST_TEST(progress == whole);

    answer<> raw[3];
    user.async_pull("car1:point", raw[0].take());
    user.async_pull("car1:gear", raw[1].take());
    user.async_push("car1:text", point{1.5, hostile::gear::drive}, raw[2].take());
    for (auto& each : raw) {
        run_until(io, [&] { return each.done(); });
    }
    BOOST_TEST(raw[0].value.text == text);
    BOOST_TEST(raw[1].value.text == R"({"value":"drive"})");
    BOOST_TEST(pushed == text);
    BOOST_TEST(cles::detail::to_body(everything()) == whole);
    BOOST_TEST(cles::detail::to_body(std::optional{point{1.5, hostile::gear::drive}}) == text);
}

BOOST_FIXTURE_TEST_CASE(updates_are_converted_by_the_library, nodes) {
    std::vector<std::string> values;
    const auto follow = [&]() -> boost::asio::awaitable<void> {
        auto feed = co_await user.async_bind<all_of_it>("car1:noun", boost::asio::use_awaitable);
        auto other = co_await user.async_bind<cles::json_text>("car1:noun");
        const auto publish = car.make_publisher();
        const auto value = everything();
        for (int i = 0; i < 3; ++i) {
            if (i == 0) {
                car.update("noun", value);
            } else if (i == 1) {
                publish.update("noun", value);
            } else {
                co_await car.async_update("noun", value);
            }
            auto event = co_await feed.async_next();
            while (event.kind != cles::feed_event::update) {
                event = co_await feed.async_next();
            }
            values.push_back(converted(event.value));
            auto raw = co_await other.async_next();
            while (raw.kind != cles::feed_event::update) {
                raw = co_await other.async_next();
            }
            values.push_back(raw.value.text);
        }
    };
    bool ended = false;
    boost::asio::co_spawn(io, follow(), [&](const std::exception_ptr& thrown) {
        ended = true;
        BOOST_TEST(!thrown);
    });
    run_until(io, [&] { return ended; });
    BOOST_TEST(values == std::vector<std::string>(6, whole), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_SUITE_END()
