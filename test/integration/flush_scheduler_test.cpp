// SPDX-License-Identifier: BSL-1.0
// When the output of a service is written: inside the call if it is the only output, otherwise together, a turn later.

#include <cles/service.hpp>

#include "support/data_test_case.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"
#include "support/test_suite.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/use_future.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <future>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

// A value that performs an action while it is written, and then fails if requested.
struct acting {
    std::function<void()> act;
    bool fails = false;
};

} // namespace

template <>
struct cles::converter<acting> {
    static void write(json_writer& w, const acting& value) {
        value.act();
        if (value.fails) {
            throw std::runtime_error("cannot be written");
        }
        w.value(std::int64_t{7});
    }
};

CLES_TEST_SUITE(flush_scheduler)

using namespace cles::test;
namespace asio = boost::asio;

struct publishing {
    explicit publishing(carrier kind = carrier::tcp4) : car(io, listening("car1", kind)) {
        for (const auto* noun : {"speed", "course"}) {
            car.update(noun, 0);
            BOOST_TEST(peer.ask(std::string{"BIND self:"} + noun) == "{\"value\":0}");
        }
    }
    // What the peer's socket has received, without running anything.
    std::string come() {
        peer.ended();
        auto text = peer.unread();
        return text;
    }

    asio::io_context io;
    cles::service car;
    scripted_peer peer{io, car.endpoints().front()};
};

std::size_t count(const std::string& text, const std::string& part) {
    std::size_t found = 0;
    for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
        ++found;
    }
    return found;
}

CLES_DATA_TEST_CASE(an_update_alone_is_written_in_its_call, every_socket, kind) {
    publishing p{kind};
    p.car.update("speed", 1);
    BOOST_TEST(p.come().ends_with("{\"value\":1}\n"), p.come());
}

BOOST_AUTO_TEST_CASE(those_behind_it_follow_in_their_order) {
    publishing p;
    for (int i = 1; i <= 40; ++i) {
        p.car.update("speed", i);
    }
    for (int i = 1; i <= 40; ++i) {
        const auto line = p.peer.line();
        BOOST_TEST(line.ends_with("{\"value\":" + std::to_string(i) + "}"), line);
    }
}

BOOST_AUTO_TEST_CASE(one_that_cannot_be_written_holds_nothing_up) {
    publishing p;
    BOOST_CHECK_THROW(p.car.update("speed", acting{.act = [] {}, .fails = true}), std::runtime_error);
    BOOST_TEST(p.come().empty());
    p.car.update("speed", 2);
    BOOST_TEST(p.peer.line().ends_with("{\"value\":2}"));
}

BOOST_AUTO_TEST_CASE(what_is_published_while_another_is_written_goes_out_even_where_that_fails) {
    for (const bool fails : {false, true}) {
        publishing p;
        const acting value{.act = [&] { p.car.update("course", 1); }, .fails = fails};
        if (fails) {
            BOOST_CHECK_THROW(p.car.update("speed", value), std::runtime_error);
        } else {
            p.car.update("speed", value);
        }
        std::string all;
        run_until(p.io, [&] {
            all = p.come();
            return count(all, "\n") == (fails ? 1U : 2U);
        });
        BOOST_TEST(count(all, "UPDATE car1:course") == 1U, all);
        BOOST_TEST(count(all, "UPDATE car1:speed") == (fails ? 0U : 1U), all);
    }
}

BOOST_AUTO_TEST_CASE(the_service_may_be_stopped_while_an_update_is_written) {
    publishing p;
    p.car.update("speed", acting{.act = [&] { p.car.stop(); }});
    run_until(p.io, [&] { return p.peer.ended(); });
    p.car.update("speed", 2);
    BOOST_TEST(p.come().find("\"value\":2") == std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_publication_that_waits_for_capacity_is_written_in_its_call_too) {
    publishing p;
    auto done = p.car.async_update("speed", 1, asio::use_future);
    BOOST_TEST(p.come().ends_with("{\"value\":1}\n"));
    BOOST_TEST((done.wait_for(std::chrono::seconds{0}) == std::future_status::timeout)); // called by the loop only
    run_until(p.io, [&] { return done.wait_for(std::chrono::seconds{0}) == std::future_status::ready; });
    done.get();
}

BOOST_AUTO_TEST_CASE(what_a_handler_publishes_follows_its_reply) {
    publishing p;
    const auto answer = [&](const cles::request&) {
        p.car.update("speed", 1);
        return 2;
    };
    p.car.on_push("plainly", answer);
    p.car.on_push("later", [&](const cles::request&) -> asio::awaitable<int> {
        p.car.update("speed", 1);
        co_return 2;
    });
    for (const std::string task : {"plainly", "later"}) {
        p.peer.send("PUSH self:" + task + " id=1\nPUSH self:" + task + " id=2\n");
        for (const std::string id : {"1", "2"}) {
            const auto line = p.peer.line();
            BOOST_TEST(line == "id=" + id + " {\"value\":2}");
        }
        for (int i = 0; i < 2; ++i) {
            BOOST_TEST(p.peer.line().starts_with("UPDATE car1:speed"));
        }
    }
}

struct asking {
    asking() : tower(io, {.name = "tower", .peers = {{"car1", far.url()}}}) {
        ask(); // dials
        link.emplace_back(far.accept());
        answer();
    }
    void ask() {
        tower.async_pull<int>("car1:speed", [this](boost::system::error_code, int value) { values.push_back(value); });
    }
    // Replies to the next request.
    void answer() {
        const auto request = peer().line();
        const auto id = request.substr(request.find("id="));
        const auto expected = values.size() + 1;
        peer().send(id.substr(0, id.find(' ')) + " {\"value\":5}\n");
        run_until(io, [&] { return values.size() == expected; });
    }
    std::size_t come() {
        peer().ended();
        return count(peer().unread(), "\n");
    }
    scripted_peer& peer() { return link.front(); }

    asio::io_context io;
    scripted_listener far{io};
    cles::service tower;
    std::vector<scripted_peer> link;
    std::vector<int> values;
};

BOOST_AUTO_TEST_CASE(a_request_alone_on_its_link_is_written_in_its_call) {
    asking a;
    a.ask();
    BOOST_TEST(a.come() == 1U);
    a.answer();
    BOOST_TEST(a.values.size() == 2U);
}

BOOST_AUTO_TEST_CASE(those_behind_it_go_together_a_turn_later) {
    asking a;
    for (int i = 0; i < 5; ++i) {
        a.ask();
    }
    BOOST_TEST(a.come() == 1U);
    run_until(a.io, [&] { return a.come() == 5; });
    for (int i = 0; i < 5; ++i) {
        a.answer();
    }
    BOOST_TEST(a.values.size() == 6U);
}

BOOST_AUTO_TEST_SUITE_END()
