// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "node/publish/feed_mailbox.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>

namespace feed_mailbox {
namespace {

using event_ptr = cles::core::feed_mailbox::event_ptr;

/// One wait for an event; it lives on the stack of its test.
struct wait final : cles::detail::pending_event {
    bool deliver(const cles::detail::raw_event& event) override {
        if (!event.has_json()) {
            return false;
        }
        text = event.body;
        return true;
    }
    void fail(boost::system::error_code code, std::string_view) override { failed = code; }
    void discard() noexcept override {}
    std::string text;
    boost::system::error_code failed;
};

struct fixture {
    wait w; // destroyed last: a waiting operation is discarded
    cles::core::completion_queue completions;
    cles::core::feed_mailbox mail{cles::limits{}, completions};
};

} // namespace
} // namespace feed_mailbox

BOOST_FIXTURE_TEST_SUITE(feed_mailbox, fixture)

BOOST_AUTO_TEST_CASE(a_waiting_operation_gets_an_event_at_once) {
    BOOST_TEST(!mail.next(event_ptr{&w}));
    BOOST_TEST(mail.has_waiter());
    BOOST_TEST(mail.put({.body = "[1]"}));
    BOOST_TEST(w.text == "[1]");
    BOOST_TEST(!mail.has_waiter());
}

BOOST_AUTO_TEST_CASE(an_event_is_kept_until_it_is_fetched) {
    BOOST_TEST(mail.put({.body = "[1]"}));
    BOOST_TEST(mail.next(event_ptr{&w}));
    BOOST_TEST(w.text.empty()); // not from inside the call
    mail.pump();
    BOOST_TEST(w.text == "[1]");
}

BOOST_AUTO_TEST_CASE(a_body_that_is_not_json_is_refused_and_the_wait_continues) {
    BOOST_TEST(!mail.put({.body = "{"}));
    BOOST_TEST(!mail.next(event_ptr{&w}));
    BOOST_TEST(!mail.put({.body = "{"}));
    BOOST_TEST(mail.has_waiter());
    mail.cancel();
    BOOST_TEST((w.failed == cles::errc::cancelled));
}

BOOST_AUTO_TEST_CASE(it_keeps_nothing_once_closed) {
    BOOST_TEST(!mail.next(event_ptr{&w}));
    BOOST_TEST((mail.close().get() == &w));
    BOOST_TEST(mail.closed());
    BOOST_TEST(mail.put({.body = "[1]"}));
    BOOST_TEST(!mail.next(event_ptr{&w}));
}

BOOST_AUTO_TEST_SUITE_END()
