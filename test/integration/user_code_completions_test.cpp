// SPDX-License-Identifier: BSL-1.0
// Completion handlers of requests, what they may do, when they are called and when they are destroyed (CONTRIBUTING.md,
// "User code"). Other user code: user_code_test.cpp.

#include <cles/service.hpp>

#include "support/node.hpp"
#include "support/user_code_fixture.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>

namespace user_code_completions_test {

using namespace cles::test;
using namespace cles::test::user_code_fixture;
using namespace std::chrono_literals;
namespace asio = boost::asio;

enum class asking : std::uint8_t { push, pull, delegate, bind };
constexpr std::array every_asking{asking::push, asking::pull, asking::delegate, asking::bind};
constexpr std::array<const char*, 4> asking_names{"push", "pull", "delegate", "bind"};

std::ostream& operator<<(std::ostream& out, asking a) { return out << asking_names[static_cast<std::size_t>(a)]; }

template <class Handler>
void ask(cles::service& by, asking how, const std::string& node, int which, const cles::call_options& options,
         Handler on_end) {
    switch (how) {
    case asking::push: by.async_push(node + ":note", cles::json_text{}, options, std::move(on_end)); break;
    case asking::pull: by.async_pull(node + ":speed", options, std::move(on_end)); break;
    case asking::delegate: by.async_delegate(node + ":work", cles::json_text{}, options, std::move(on_end)); break;
    case asking::bind: {
        cles::bind_options bound;
        bound.deadline(options.deadline_);
        by.async_bind(node + ":place" + (which == 0 ? "" : std::to_string(which)), bound, std::move(on_end));
        break;
    }
    }
}

/// Starts three requests, the second of which acts, and completes them there. The peer is silent, or replies.
/// `reports`: of the second.
template <class Act>
void end_three(world& w, asking how, place where, Act acting, std::array<int, 3>& calls,
               std::function<void(double, std::string_view)> reports = {}) {
    const std::string node = where == place::not_connected                      ? "nowhere"
                             : where == place::reply || where == place::refusal ? "car2"
                                                                                : "car1";
    cles::call_options options;
    options.deadline(where == place::deadline ? 30ms : 20s);
    if (where == place::refusal) {
        w.car = std::make_unique<cles::service>(w.io, listening("car2"));
        w.tower->set_peer("car2", w.car->endpoints().front());
    }
    const auto bystander = [&](std::size_t i) { return handler{&w, &calls[i], deed::nothing}; };
    ask(*w.tower, how, node, 0, options, asio::bind_cancellation_slot(w.first.slot(), bystander(0)));
    {
        auto second = options;
        if (reports) {
            second.on_progress(std::exchange(reports, {}));
        }
        ask(*w.tower, how, node, 1, second, asio::bind_cancellation_slot(w.second.slot(), std::move(acting)));
    }
    ask(*w.tower, how, node, 2, options, asio::bind_cancellation_slot(w.third.slot(), bystander(2)));
    if (where == place::lost) {
        auto peer = w.silent.accept();
        peer.line();
        peer.reset();
    } else if (where == place::cancelled) {
        w.second.emit(asio::cancellation_type::terminal);
        w.first.emit(asio::cancellation_type::partial);
        w.third.emit(asio::cancellation_type::total);
    } else if (where == place::stop) {
        w.tower->stop();
    }
    BOOST_TEST(calls[1] == 0); // never inside the call
    BOOST_TEST(w.acted == 0);
}

} // namespace user_code_completions_test

BOOST_AUTO_TEST_SUITE(user_code_completions)

using namespace user_code_completions_test;

namespace data = boost::unit_test::data;

BOOST_DATA_TEST_CASE(a_completion_handler_may_do_anything, data::make(every_asking) * every_place * every_deed, how,
                     where, does) {
    world w;
    std::array<int, 3> calls{};
    end_three(w, how, where, handler{&w, &calls[1], does}, calls);
    check_that_three_are_called(w, does, calls);
}

BOOST_DATA_TEST_CASE(a_handler_may_do_it_when_it_is_destroyed, data::make(every_asking) * every_place * every_deed, how,
                     where, does) {
    if (does == deed::throws) { // destructors do not throw
        return;
    }
    world w;
    std::array<int, 3> calls{};
    end_three(
        w, how, where,
        [doing = std::make_shared<doer>(w, does), n = &calls[1]](boost::system::error_code, const auto&) { ++*n; },
        calls);
    check_that_three_are_called(w, does, calls);
}

// A progress function is destroyed with its request.
BOOST_DATA_TEST_CASE(a_progress_function_may_act_when_it_is_destroyed, data::make(every_place) * every_deed, where,
                     does) {
    if (does == deed::throws) { // destructors do not throw
        return;
    }
    world w;
    std::array<int, 3> calls{};
    end_three(w, asking::delegate, where, handler{&w, &calls[1], deed::nothing}, calls,
              [doing = std::make_shared<doer>(w, does)](double, std::string_view) {});
    w.until([&] { return calls[0] != 0 && calls[1] != 0 && calls[2] != 0; });
    w.run_what_is_ready();
    w.acted = 1;
    w.check_that_it_works(does);
    BOOST_TEST(calls == (std::array{1, 1, 1}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_SUITE_END()
