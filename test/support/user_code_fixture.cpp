// SPDX-License-Identifier: BSL-1.0
#include "support/user_code_fixture.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <utility>

namespace cles::test::user_code_fixture {

using namespace std::chrono_literals;

world::world(service_options own) {
    own.name = "tower";
    own.listen = {fresh_address(carrier::tcp4)};
    own.peers = {{"car1", silent.url()},
                 {"car2", car->endpoints().front()},
                 {"car3", friendly->endpoints().front()},
                 {"nowhere", "tcp://127.0.0.1:1"}};
    tower = std::make_unique<service>(io, std::move(own));
    for (auto* each : {car.get(), friendly.get()}) {
        each->on_pull("speed", [] { return 42; });
        each->on_push("note", [] {});
        each->on_delegate("work", [] { return 42; });
        each->on_delegate("long", [this](const request&, responder r) { jobs.push_back(std::move(r)); });
        for (const auto* noun : {"place", "place1", "place2", "victim"}) {
            each->on_bind(noun);
        }
    }
    tower->async_bind("car3:victim", [this](boost::system::error_code, feed<json_text> made) {
        victim = std::make_unique<feed<json_text>>(std::move(made));
        victim->async_next([this](boost::system::error_code, const feed_item<json_text>&) { ++victim_ended; });
    });
    tower->async_delegate("car3:long", json_text{},
                          boost::asio::bind_cancellation_slot(patient_signal.slot(), patient.take()));
    until([&] { return victim && jobs.size() == 1; });
    endless = std::exchange(jobs, {});
}

world::~world() {
    jobs.clear();
    endless.clear();
    victim.reset();
    tower.reset();
}

void world::act(deed d) {
    ++acted;
    switch (d) {
    case deed::nothing: break;
    case deed::throws: throw thrown_by_test{};
    case deed::cancels:
        for (auto* each : {&patient_signal, &first, &third}) {
            each->emit(boost::asio::cancellation_type::terminal);
        }
        break;
    case deed::stops_service:
        if (tower) {
            tower->stop();
        }
        break;
    case deed::destroys_service: tower.reset(); break;
    case deed::destroys_feed: victim.reset(); break;
    case deed::begins:
        if (tower) {
            tower->async_pull("car3:speed", begun.take());
            tower->async_pull("car1:speed", call_options{}.deadline(1s), [](auto, const auto&) {});
            tower->async_bind("nowhere:place", [](auto, const auto&) {});
            tower->async_update("own", 1, [](auto) {});
            tower->update("own", 2);
        }
        break;
    }
}

void world::run_what_is_ready() {
    for (;;) {
        try {
            run_ready(io);
            return;
        } catch (const thrown_by_test&) {
            ++thrown;
        }
    }
}

void world::check_that_it_works(deed d) {
    if (!tower) {
        run_what_is_ready();
    } else {
        answer<int> alive;
        answer<> late;
        tower->async_pull<int>("car3:speed", alive.take());
        tower->async_pull("car1:silence", call_options{}.deadline(10ms), late.take());
        until([&] { return alive.done() && late.done(); });
        if (alive.code == errc::stopped) {
            run_what_is_ready();
        } else {
            BOOST_TEST(alive.value == 42);
            BOOST_TEST(late.code == errc::deadline);
        }
    }
    BOOST_TEST(thrown == (d == deed::throws ? acted : 0));
    if (d == deed::destroys_service || d == deed::stops_service) {
        until([&] { return patient.done(); });
        BOOST_TEST(patient.code == errc::stopped);
    } else if (d == deed::cancels && acted != 0 && patient.code != errc::stopped) {
        until([&] { return patient.done(); });
        BOOST_TEST(patient.code == errc::cancelled);
    } else if (d == deed::destroys_feed && acted != 0) {
        until([&] { return victim_ended == 1; });
    } else if (d == deed::begins && acted != 0 && tower) {
        until([&] { return begun.done(); });
    }
}

void check_that_three_are_called(world& w, deed does, const std::array<int, 3>& calls) {
    w.until([&] { return calls[0] != 0 && calls[1] != 0 && calls[2] != 0; });
    w.acted = 1; // the others did nothing
    w.check_that_it_works(does);
    BOOST_TEST(calls == (std::array{1, 1, 1}), boost::test_tools::per_element());
}

} // namespace cles::test::user_code_fixture
