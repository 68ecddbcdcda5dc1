// SPDX-License-Identifier: BSL-1.0
// Every operation honours its cancellation slot, of any type, until it completes; it never completes inside the
// emission, and the slot has no effect from its handler on.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <utility>

namespace cancellation_test {

using namespace cles::test;
using cles::errc;
namespace asio = boost::asio;
using type = asio::cancellation_type;

enum class operation : std::uint8_t { push, pull, delegate, request, bind, next, update };
constexpr std::array every_operation{operation::push, operation::pull, operation::delegate, operation::request,
                                     operation::bind, operation::next, operation::update};
std::ostream& operator<<(std::ostream& out, operation o) {
    constexpr std::array names{"push", "pull", "delegate", "request", "bind", "next", "update"};
    return out << names[static_cast<std::size_t>(o)];
}

struct kind {
    type value;
    const char* name;
};
std::ostream& operator<<(std::ostream& out, const kind& k) { return out << k.name; }
const std::array every_kind{kind{type::terminal, "terminal"}, kind{type::partial, "partial"},
                            kind{type::total, "total"}, kind{type::all, "all"}};

struct fixture {
    fixture() {
        car.on_pull("speed", [] { return 42; });
        car.on_push("note", [] {});
        car.on_delegate("work", [] { return 42; });
        car.on_bind("place");
        tower.on_bind("full");
    }

    /// Accepts any result of an operation.
    struct taker {
        fixture* in;
        template <class T>
        void operator()(boost::system::error_code failed, T&& result) const {
            if constexpr (std::is_same_v<std::remove_cvref_t<T>, cles::feed<cles::json_text>>) {
                in->bound = std::forward<T>(result);
            }
            (*this)(failed);
        }
        void operator()(boost::system::error_code failed) const {
            ++in->calls;
            in->code = failed;
            in->slot_is_free = !in->signal.slot().has_handler();
            in->signal.emit(type::all); // inside its handler: has no effect any more
        }
    };

    /// Starts the operation; it waits, or ends soon.
    void begin(operation what, bool waits) {
        auto handler = asio::bind_cancellation_slot(signal.slot(), taker{this});
        const std::string node = waits ? "car1" : "car2";
        switch (what) {
        case operation::push: tower.async_push(node + ":note", cles::json_text{}, handler); break;
        case operation::pull: tower.async_pull(node + ":speed", handler); break;
        case operation::delegate: tower.async_delegate(node + ":work", cles::json_text{}, handler); break;
        case operation::request: tower.async_request("PULL " + node + ":speed", handler); break;
        case operation::bind: tower.async_bind(node + ":place", handler); break;
        case operation::next:
            bind();
            bound.async_next(handler);
            if (!waits) {
                car.update("place", 1);
            }
            break;
        case operation::update:
            if (waits) {
                fill();
            }
            tower.async_update("full", 1, handler);
            break;
        }
    }
    void bind() {
        tower.async_bind("car2:place", [this](boost::system::error_code, cles::feed<cles::json_text> made) {
            bound = std::move(made);
        });
        run_until(io, [&] { return bound.is_open(); });
    }
    // A subscriber that reads nothing.
    void fill() {
        slow.emplace(io, tower.endpoints().front(), buffers::small);
        slow->ask("BIND self:full keep=1");
        for (int i = 0; i < 300; ++i) {
            tower.async_update("full", std::string(50'000, '.'), [](boost::system::error_code) {});
        }
        run_ready(io);
    }
    void wait() {
        run_until(io, [&] { return calls != 0; });
        run_ready(io);
        BOOST_TEST(calls == 1);
        BOOST_TEST(slot_is_free);
    }

    asio::io_context io;
    scripted_listener silent{io};
    cles::service car{io, listening("car2")};
    cles::service tower{io, [this] {
                            auto options = listening("tower");
                            options.peers = {{"car1", silent.url()}, {"car2", car.endpoints().front()}};
                            return options;
                        }()};
    std::optional<scripted_peer> slow;
    asio::cancellation_signal signal;
    int calls = 0;
    boost::system::error_code code;
    bool slot_is_free = false;
    cles::feed<cles::json_text> bound;
};

} // namespace cancellation_test

BOOST_AUTO_TEST_SUITE(cancellation)

using namespace cancellation_test;
namespace data = boost::unit_test::data;

BOOST_DATA_TEST_CASE_F(fixture, before_it_begins_it_means_nothing, data::make(every_operation) * every_kind, what,
                       how) {
    signal.emit(how.value);
    begin(what, false);
    wait();
    BOOST_TEST(!code, code.message());
}

BOOST_DATA_TEST_CASE_F(fixture, while_it_waits_it_is_withdrawn, data::make(every_operation) * every_kind, what, how) {
    begin(what, true);
    run_ready(io);
    BOOST_TEST(calls == 0);
    signal.emit(how.value);
    BOOST_TEST(calls == 0); // never inside the emission
    signal.emit(how.value);
    wait();
    BOOST_TEST(code == errc::cancelled);
    if (what == operation::next) { // the feed is unchanged
        BOOST_TEST(bound.is_open());
    }
}

BOOST_DATA_TEST_CASE_F(fixture, in_the_call_that_begins_it_it_is_withdrawn, data::make(every_operation) * every_kind,
                       what, how) {
    begin(what, true);
    signal.emit(how.value);
    BOOST_TEST(calls == 0);
    wait();
    BOOST_TEST(code == errc::cancelled);
}

BOOST_DATA_TEST_CASE_F(fixture, an_emission_of_no_type_means_nothing, data::make(every_operation), what) {
    begin(what, false);
    signal.emit(type::none);
    wait();
    BOOST_TEST(!code, code.message());
}

BOOST_DATA_TEST_CASE_F(fixture, afterwards_it_means_nothing, data::make(every_operation) * every_kind, what, how) {
    begin(what, false);
    wait();
    BOOST_TEST(!code, code.message());
    // Another operation of the same kind waits with a different slot, and must not be affected.
    if (!bound.is_open()) {
        bind();
    }
    int events = 0;
    bound.async_next([&](boost::system::error_code failed, const cles::feed_item<cles::json_text>&) {
        BOOST_TEST(!failed);
        ++events;
    });
    signal.emit(how.value);
    run_ready(io);
    BOOST_TEST(calls == 1);
    if (events == 0) {
        car.update("place", 2);
        run_until(io, [&] { return events == 1; });
    }
    BOOST_TEST(bound.is_open());
}

BOOST_FIXTURE_TEST_CASE(an_update_that_was_withdrawn_is_not_published, fixture) {
    tower.on_bind("other");
    begin(operation::update, true);
    int behind = 0;
    tower.async_update("full", 2, [&](boost::system::error_code failed) {
        BOOST_TEST(!failed);
        ++behind;
    });
    signal.emit(type::total);
    wait();
    BOOST_TEST(code == errc::cancelled);
    BOOST_TEST(behind == 0);
    slow->reset(); // frees its capacity
    run_until(io, [&] { return behind == 1; });
    scripted_peer late{io, tower.endpoints().front()};
    BOOST_TEST(late.ask("BIND self:full") == "{\"value\":2}");
    BOOST_TEST(calls == 1);
}

// A second wait fails; its slot is not that of the first.
BOOST_FIXTURE_TEST_CASE(a_slot_withdraws_its_own_operation_only, fixture) {
    bind();
    int first = 0;
    bound.async_next([&](boost::system::error_code, const cles::feed_item<cles::json_text>&) { ++first; });
    bound.async_next(asio::bind_cancellation_slot(signal.slot(), taker{this}));
    signal.emit(type::terminal);
    wait();
    BOOST_TEST(code == errc::busy);
    BOOST_TEST(first == 0);
    car.update("place", 1);
    run_until(io, [&] { return first == 1; });
}

BOOST_AUTO_TEST_SUITE_END()
