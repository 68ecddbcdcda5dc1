// SPDX-License-Identifier: BSL-1.0
// Every kind of user code that the library calls, what it may do, and where it may be called: nothing else is harmed
// (CONTRIBUTING.md, "User code"). Completion handlers of requests: user_code_completions_test.cpp.

#include <cles/job_feed.hpp>
#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"
#include "support/user_code_fixture.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

namespace user_code_test {

using namespace cles::test;
using namespace cles::test::user_code_fixture;
using namespace std::chrono_literals;
namespace asio = boost::asio;

/// Tasks whose handlers act, one of each form, and "quick", which counts.
void offer_acting(world& w, deed does, int& quick) {
    w.tower->on_pull("plain", [&w, does] {
        w.act(does);
        return 1;
    });
    w.tower->on_pull("later", [&w, does](const cles::request&, const cles::responder& r) {
        w.act(does);
        r.done(1);
    });
    w.tower->on_pull("awaited", [&w, does]() -> asio::awaitable<int> {
        w.act(does);
        co_return 1;
    });
    w.tower->on_pull("quick", [&quick] { return ++quick; });
}

constexpr std::array acting{"plain", "later", "awaited"};

/// The requests 1, which acted, and 2, of "quick", have been replied to, if the service still exists.
void check_answers(world& w, scripted_peer& peer, deed does, int quick) {
    w.run_what_is_ready();
    BOOST_TEST(w.thrown == 0);
    if (w.tower && does != deed::stops_service) {
        const auto one = peer.line();
        const auto other = peer.line();
        const auto& mine = one.starts_with("id=1 ") ? one : other;
        BOOST_TEST((mine.find(does == deed::throws ? "failed" : "\"value\":1}") != std::string::npos), mine);
        BOOST_TEST(quick == 1);
    }
    w.acted = does == deed::throws ? 0 : 1;
    w.check_that_it_works(does);
}

/// Starts three operations, each with a separate handler and cancellation slot: the second handler acts.
template <class Begin>
void begin_three(world& w, deed does, std::array<int, 3>& calls, Begin begin) {
    const std::array<asio::cancellation_signal*, 3> signals{&w.first, &w.second, &w.third};
    for (std::size_t i = 0; i < 3; ++i) {
        begin(i,
              asio::bind_cancellation_slot(signals[i]->slot(), handler{&w, &calls[i], i == 1 ? does : deed::nothing}));
    }
}

/// Cancels them, the one that acts first.
void cancel_three(world& w, asio::cancellation_type how) {
    for (auto* each : {&w.second, &w.first, &w.third}) {
        each->emit(how);
    }
}

} // namespace user_code_test

BOOST_AUTO_TEST_SUITE(user_code)

using namespace user_code_test;

namespace data = boost::unit_test::data;

// Those of one noun share a binding.
BOOST_DATA_TEST_CASE(who_waits_for_an_event_may_do_anything, data::make(every_deed) * data::make({false, true}), does,
                     share) {
    for (const auto where : {place::reply, place::queued, place::lost, place::cancelled, place::stop}) {
        BOOST_TEST_CONTEXT("at " << where) {
            world w;
            std::vector<std::unique_ptr<cles::feed<cles::json_text>>> feeds;
            for (const std::string noun : {"car2:place", "car2:place1", "car2:place2"}) {
                w.tower->async_bind(share ? "car2:place" : noun,
                                    [&](boost::system::error_code, cles::feed<cles::json_text> made) {
                                        feeds.push_back(std::make_unique<cles::feed<cles::json_text>>(std::move(made)));
                                    });
            }
            w.until([&] { return feeds.size() == 3; });
            std::array<int, 3> calls{};
            const auto update_all = [&] {
                w.car->update("place", 1);
                w.car->update("place1", 2);
                w.car->update("place2", 3);
            };
            if (where == place::queued) {
                update_all();
                update_all();
                w.run_what_is_ready();
            }
            begin_three(w, does, calls, [&](std::size_t i, auto on_end) { feeds[i]->async_next(std::move(on_end)); });
            if (where == place::reply) {
                update_all();
            } else if (where == place::lost) {
                w.car.reset();
            } else if (where == place::cancelled) {
                cancel_three(w, asio::cancellation_type::terminal);
            } else if (where == place::stop) {
                w.tower->stop();
            }
            BOOST_TEST(calls[1] == 0);
            check_that_three_are_called(w, does, calls);
        }
    }
}

CLES_DATA_TEST_CASE(a_publisher_that_waits_may_do_anything, every_deed, does) {
    for (const auto where : {place::reply, place::cancelled, place::stop}) {
        BOOST_TEST_CONTEXT("at " << where) {
            world w;
            w.tower->on_bind("full");
            scripted_peer slow{w.io, w.tower->endpoints().front(), buffers::small};
            slow.ask("BIND self:full keep=1");
            const std::string padding(50'000, '.');
            int filled = 0;
            if (where != place::reply) {
                for (int i = 0; i < 300; ++i) {
                    w.tower->async_update("full", padding, [&](boost::system::error_code) { ++filled; });
                }
                w.run_what_is_ready();
                BOOST_TEST(filled < 300);
            }
            std::array<int, 3> calls{};
            begin_three(w, does, calls, [&](std::size_t i, auto on_end) {
                w.tower->async_update("full", static_cast<int>(i), std::move(on_end));
            });
            if (where == place::cancelled) {
                cancel_three(w, asio::cancellation_type::total);
            } else if (where == place::stop) {
                w.tower->stop();
            }
            BOOST_TEST(calls[1] == 0);
            check_that_three_are_called(w, does, calls);
        }
    }
}

CLES_DATA_TEST_CASE(a_progress_function_may_do_anything, every_deed, does) {
    world w;
    int reports = 0;
    answer<int> a;
    answer<int> b;
    w.tower->async_delegate<int>("car2:long", cles::json_text{},
                                 cles::call_options{}.on_progress([&](double, std::string_view) {
                                     ++reports;
                                     w.act(does);
                                 }),
                                 a.take());
    w.tower->async_delegate<int>("car2:long", cles::json_text{}, b.take());
    w.until([&] { return w.jobs.size() == 2; });
    w.jobs[0].progress(0.25);
    w.jobs[0].progress(0.5);
    w.jobs[0].done(1);
    w.jobs[1].done(2);
    w.until([&] { return a.done() && b.done(); });
    w.check_that_it_works(does);
    const bool ended = does == deed::stops_service || does == deed::destroys_service;
    BOOST_TEST(reports == (ended ? 1 : 2));
    BOOST_TEST(a.code.failed() == ended);
    BOOST_TEST(b.code.failed() == ended);
    BOOST_TEST(a.calls == 1);
    BOOST_TEST(b.calls == 1);
}

// It is destroyed with its operation, or after it; never inside a call of the library.
BOOST_DATA_TEST_CASE(a_progress_callback_may_act_when_it_is_destroyed, data::make(every_place) * every_deed, where,
                     does) {
    if (does == deed::throws) { // destructors do not throw
        return;
    }
    for (const bool sent : {false, true}) { // or it waits for its link
        if (sent && where != place::cancelled && where != place::stop) {
            continue;
        }
        world w;
        int calls = 0;
        const std::string node = where == place::not_connected                      ? "nowhere"
                                 : where == place::reply || where == place::refusal ? "car2"
                                                                                    : "car1";
        if (where == place::refusal) {
            w.car = std::make_unique<cles::service>(w.io, listening("car2"));
            w.tower->set_peer("car2", w.car->endpoints().front());
        }
        {
            cles::call_options options;
            options.deadline(where == place::deadline ? 30ms : 20s);
            options.on_progress([doing = std::make_shared<doer>(w, does)](double, std::string_view) {});
            w.tower->async_delegate(
                node + ":work", cles::json_text{}, options,
                asio::bind_cancellation_slot(w.second.slot(),
                                             [&](boost::system::error_code, const cles::json_text&) { ++calls; }));
        }
        std::optional<scripted_peer> peer; // keeps its link to the end: the last request waits on it
        if (where == place::lost || sent) {
            peer.emplace(w.silent.accept());
            peer->line();
            if (where == place::lost) {
                peer->reset();
            } else if (where == place::stop) {
                w.tower->stop();
            } else {
                w.second.emit(asio::cancellation_type::terminal);
            }
            BOOST_TEST(w.acted == 0);
            w.until([&] { return w.acted == 1; });
        } else {
            if (where == place::stop) {
                w.tower->stop();
            } else if (where == place::cancelled) {
                w.second.emit(asio::cancellation_type::terminal);
            }
            BOOST_TEST(w.acted == 0);
            w.until([&] { return w.acted == 1; });
        }
        BOOST_TEST(calls == 1);
        w.check_that_it_works(does);
    }
}

CLES_DATA_TEST_CASE(a_stop_callback_may_do_anything, every_deed, does) {
    for (const auto where : {place::deadline, place::lost, place::cancelled, place::stop}) {
        BOOST_TEST_CONTEXT("at " << where) {
            world w;
            std::vector<cles::responder> begun;
            std::array<int, 3> told{};
            w.tower->on_delegate("job", [&](const cles::request&, cles::responder r) {
                const auto i = begun.size();
                r.on_stop([&, i] {
                    ++told[i];
                    w.act(i == 1 ? does : deed::nothing);
                });
                begun.push_back(std::move(r));
            });
            scripted_peer peer{w.io, w.tower->endpoints().front()};
            for (const auto* id : {"1", "2", "3"}) {
                peer.send("DELEGATE self:job id=" + std::string{id} +
                          (where == place::deadline ? " deadline=30\n" : " deadline=20000\n"));
            }
            w.until([&] { return begun.size() == 3; });
            if (where == place::lost) {
                peer.reset();
            } else if (where == place::cancelled) {
                peer.shut();
            } else if (where == place::stop) {
                w.tower->stop();
                BOOST_TEST(told[1] == 0);
            }
            check_that_three_are_called(w, does, told);
        }
    }
}

// An exception from a handler becomes its reply; the lines after it are served.
CLES_DATA_TEST_CASE(a_handler_for_requests_may_do_anything, every_deed, does) {
    for (const auto* task : acting) {
        BOOST_TEST_CONTEXT(task) {
            world w;
            int quick = 0;
            offer_acting(w, does, quick);
            scripted_peer peer{w.io, w.tower->endpoints().front()};
            peer.send("PULL self:" + std::string{task} + " id=1\nPULL self:quick id=2\n");
            w.until([&] { return w.acted == 1; });
            check_answers(w, peer, does, quick);
        }
    }
}

// What it throws is the answer of its job.
CLES_DATA_TEST_CASE(a_callback_of_a_jobs_feed_may_do_anything, every_deed, does) {
    world w;
    int quick = 0;
    offer_acting(w, does, quick);
    w.tower->update("watched", 1);
    cles::job_feed watched;
    w.tower->on_delegate("job", [&](const cles::request&, const cles::responder& job) {
        watched = job.bind("self:watched");
        watched.next([&w, does, job](boost::system::error_code, const cles::job_event&) {
            w.act(does);
            job.done(1);
        });
    });
    scripted_peer peer{w.io, w.tower->endpoints().front()};
    peer.send("DELEGATE self:job id=1\nPULL self:quick id=2\n");
    w.until([&] { return w.acted == 1; });
    check_answers(w, peer, does, quick);
}

// As one of the nodes that `any` or `all` select.
BOOST_DATA_TEST_CASE(a_handler_that_is_chosen_may_do_anything, data::make({"any", "all"}) * every_deed, target, does) {
    for (const auto* task : acting) {
        BOOST_TEST_CONTEXT(task) {
            cles::service_options routes;
            routes.routing = cles::routing();
            world w{std::move(routes)};
            int quick = 0;
            offer_acting(w, does, quick);
            scripted_peer peer{w.io, w.tower->endpoints().front()};
            peer.send("PULL " + std::string{target} + ":" + task + " id=1\nPULL self:quick id=2\n");
            w.until([&] { return w.acted == 1; });
            check_answers(w, peer, does, quick);
        }
    }
}

// It starts in a turn of its link, wherever the request before it ends: there the library may iterate over a list that
// the handler changes.
BOOST_DATA_TEST_CASE(a_handler_whose_request_has_waited_may_do_anything,
                     data::make({place::reply, place::deadline}) * every_deed, where, does) {
    for (const auto* task : acting) {
        BOOST_TEST_CONTEXT(task) {
            world w;
            int quick = 0;
            offer_acting(w, does, quick);
            std::vector<cles::responder> begun;
            w.tower->on_delegate("job",
                                 [&](const cles::request&, cles::responder r) { begun.push_back(std::move(r)); });
            scripted_peer peer{w.io, w.tower->endpoints().front()};
            peer.send("DELEGATE self:job deadline=" + std::string{where == place::deadline ? "30" : "20000"} +
                      "\nPULL self:" + task + "\nPULL self:quick id=2\n");
            w.until([&] { return begun.size() == 1; });
            w.until([&] { return quick == 1; }); // everything that has arrived has been read
            BOOST_TEST(peer.line().starts_with("id=2 "));
            if (where == place::reply) {
                begun[0].done(1);
                BOOST_TEST(w.acted == 0); // not inside the call
            }
            w.until([&] { return w.acted == 1; });
            w.run_what_is_ready();
            BOOST_TEST(w.thrown == 0);
            if (w.tower && does != deed::stops_service) {
                BOOST_TEST((peer.line().find(where == place::reply ? "value" : "deadline") != std::string::npos));
                BOOST_TEST((peer.line().find(does == deed::throws ? "failed" : "value") != std::string::npos));
            }
            w.acted = does == deed::throws ? 0 : 1;
            w.check_that_it_works(does);
        }
    }
}

// By the program, when it is asked for its load: nothing is started for a destroyed service.
BOOST_DATA_TEST_CASE(a_service_that_is_stopped_while_it_chooses_begins_nothing,
                     data::make({deed::stops_service, deed::destroys_service}), does) {
    for (const auto* task : acting) {
        BOOST_TEST_CONTEXT(task) {
            world* within = nullptr;
            cles::service_options routes;
            routes.routing = cles::routing();
            routes.load = [&] {
                if (within != nullptr) {
                    std::exchange(within, nullptr)->act(does);
                }
                return cles::node_load{.running = 7};
            };
            world w{std::move(routes)};
            int begun = 0;
            w.tower->on_pull("plain", [&] { return ++begun; });
            w.tower->on_pull("later", [&](const cles::request&, const cles::responder& r) { r.done(++begun); });
            w.tower->on_pull("awaited", [&]() -> asio::awaitable<int> { co_return ++begun; });
            scripted_peer peer{w.io, w.tower->endpoints().front()};
            within = &w;
            peer.send("PULL any:" + std::string{task} + " id=1\n");
            w.until([&] { return w.acted == 1; });
            w.run_what_is_ready();
            BOOST_TEST(begun == 0);
            w.check_that_it_works(does);
        }
    }
}

// The functions that return something to the library.
CLES_DATA_TEST_CASE(the_functions_of_the_options_may_do_anything, every_deed, does) {
    for (const std::string which : {"authorise", "load", "metrics", "log"}) {
        BOOST_TEST_CONTEXT(which) {
            world* within = nullptr;
            bool armed = false;
            const auto act = [&](std::string_view what) {
                if (armed && what == which) {
                    armed = false;
                    within->act(does);
                }
            };
            cles::service_options options;
            options.authorise = [&](const cles::access&) {
                act("authorise");
                return true;
            };
            options.load = [&] {
                act("load");
                return cles::node_load{.running = 7};
            };
            options.metrics = [&](cles::json_writer& out) {
                out.key("half");
                act("metrics");
                out.value(std::int64_t{1});
            };
            options.log = [&](cles::log_level, const cles::log_entry&) { act("log"); };
            world w{std::move(options)};
            within = &w;
            int served = 0;
            w.tower->on_pull("speed", [&] { return ++served; });
            scripted_peer peer{w.io, w.tower->endpoints().front()};
            scripted_peer other{w.io, w.tower->endpoints().front()};
            other.ask("PULL self:speed");
            armed = true;
            if (which == "authorise") {
                peer.send("PULL self:speed\n");
            } else if (which == "load") {
                peer.send("PULL self:cles\n");
            } else if (which == "metrics") {
                peer.send("PULL self:cles/metrics\n");
            } else {
                peer.send("GET / HTTP/1.1\n");
            }
            w.until([&] { return w.acted == 1; });
            w.run_what_is_ready();
            BOOST_TEST(w.thrown == 0);
            const bool ended = does == deed::stops_service || does == deed::destroys_service;
            if (ended) {
                BOOST_TEST(served == 1); // nothing is started that was allowed by a destroyed service
            } else if (which == "log") {
                BOOST_TEST(peer.rest().empty());
            } else {
                const auto reply = peer.line();
                BOOST_TEST(cles::is_valid_json(reply), reply);
                BOOST_TEST((reply.find("denied") != std::string::npos) ==
                           (which == "authorise" && does == deed::throws));
                BOOST_TEST((reply.find("\"half\":1") != std::string::npos) ==
                           (which == "metrics" && does != deed::throws));
            }
            if (!ended) {
                BOOST_TEST((other.ask("PULL self:speed").find("value") != std::string::npos));
            }
            w.acted = does == deed::throws ? 0 : 1;
            w.check_that_it_works(does);
        }
    }
}

// Links that are closed at the same time, each with an entry of the log.
CLES_DATA_TEST_CASE(the_log_of_a_deadline_may_do_anything, every_deed, does) {
    for (const bool stalled : {false, true}) {
        BOOST_TEST_CONTEXT((stalled ? "stalled" : "silent")) {
            world* within = nullptr;
            int entries = 0;
            cles::service_options options;
            (stalled ? options.limits.stall : options.limits.first_line) = 50ms;
            options.log = [&](cles::log_level, const cles::log_entry& e) {
                if (e.text.starts_with("closed a link ") && ++entries == 1) {
                    within->act(does);
                }
            };
            world w{std::move(options)};
            within = &w;
            w.tower->on_pull("much", [] { return std::string(500'000, 'x'); });
            std::vector<std::unique_ptr<scripted_peer>> peers;
            for (int i = 0; i < 3; ++i) {
                peers.push_back(std::make_unique<scripted_peer>(w.io, w.tower->endpoints().front(), buffers::small));
                for (int n = 0; stalled && n < 20; ++n) {
                    peers.back()->send("PULL self:much\n");
                }
            }
            w.until([&] { return w.acted == 1; });
            w.run_what_is_ready();
            BOOST_TEST(w.thrown == 0);
            if (does != deed::stops_service && does != deed::destroys_service) {
                w.until([&] { return entries == 3; });
            }
            for (const auto& each : peers) {
                w.until([&] { return each->ended(); });
            }
            w.acted = does == deed::throws ? 0 : 1;
            w.check_that_it_works(does);
        }
    }
}

BOOST_AUTO_TEST_SUITE_END()
