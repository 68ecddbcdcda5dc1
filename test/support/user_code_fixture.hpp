// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/io_context.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <ostream>
#include <source_location>
#include <vector>

/// User code that misbehaves, and what must not be affected.
namespace cles::test::user_code_fixture {

/// What user code does.
enum class deed : std::uint8_t { nothing, throws, cancels, stops_service, destroys_service, destroys_feed, begins };
inline constexpr std::array every_deed{deed::nothing,          deed::throws,        deed::cancels, deed::stops_service,
                                       deed::destroys_service, deed::destroys_feed, deed::begins};
inline constexpr std::array<const char*, 7> deed_names{"nothing",          "throws",        "cancels", "stops_service",
                                                       "destroys_service", "destroys_feed", "begins"};

/// Where a completion comes from.
enum class place : std::uint8_t { reply, refusal, deadline, lost, not_connected, cancelled, stop, queued };
inline constexpr std::array every_place{place::reply,         place::refusal,   place::deadline, place::lost,
                                        place::not_connected, place::cancelled, place::stop};
inline constexpr std::array<const char*, 8> place_names{"reply",         "refusal",   "deadline", "lost",
                                                        "not_connected", "cancelled", "stop",     "queued"};

inline std::ostream& operator<<(std::ostream& out, deed d) { return out << deed_names[static_cast<std::size_t>(d)]; }
inline std::ostream& operator<<(std::ostream& out, place p) { return out << place_names[static_cast<std::size_t>(p)]; }

struct thrown_by_test {};

/// A service whose user code misbehaves, and peers for it.
struct world {
    explicit world(service_options own = {});
    ~world();
    world(const world&) = delete;
    world& operator=(const world&) = delete;

    /// The action of user code when it is called.
    void act(deed d);

    /// Runs, and calls run again after an exception.
    template <class Condition>
    void until(Condition holds, const std::source_location& where = std::source_location::current()) {
        for (;;) {
            try {
                run_until(io, holds, patience, where);
                return;
            } catch (const thrown_by_test&) {
                ++thrown;
            }
        }
    }
    void run_what_is_ready();

    /// The service still works: it replies, and its timer is armed. Meanwhile, what is ready is run.
    void check_that_it_works(deed d);

    boost::asio::io_context io;
    scripted_listener silent{io};
    std::unique_ptr<service> car = std::make_unique<service>(io, listening("car2"));
    std::unique_ptr<service> friendly = std::make_unique<service>(io, listening("car3"));
    std::vector<responder> jobs;
    std::vector<responder> endless;
    boost::asio::cancellation_signal patient_signal; // of operations that wait all the time
    boost::asio::cancellation_signal first;          // of operations that end next to the one that acts
    boost::asio::cancellation_signal second;
    boost::asio::cancellation_signal third;
    answer<> patient;
    answer<> begun;
    std::unique_ptr<feed<json_text>> victim;
    int victim_ended = 0;
    int acted = 0;
    int thrown = 0;
    std::unique_ptr<service> tower;
};

/// A completion handler that performs an action.
struct handler {
    world* in;
    int* calls;
    deed does;

    template <class... T>
    void operator()(boost::system::error_code, const T&...) const {
        ++*calls;
        in->act(does);
    }
};

/// Performs an action when it is destroyed.
struct doer {
    doer(world& w, deed d) noexcept : in(w), does(d) {}
    doer(const doer&) = delete;
    doer& operator=(const doer&) = delete;
    ~doer() { in.act(does); }
    world& in;
    deed does;
};

/// Runs until all three have been called, and checks that each was called once and that the service still works.
void check_that_three_are_called(world& w, deed does, const std::array<int, 3>& calls);

} // namespace cles::test::user_code_fixture
