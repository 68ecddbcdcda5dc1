// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "node/publish/feed_mailbox.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

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

/// A wait for a batch. What conversions and handlers do is set by its test.
struct batch_wait final : cles::detail::pending_batch {
    verdict keep(const cles::detail::raw_event& event) override {
        if (!event.has_json()) {
            return verdict::malformed;
        }
        if (unreadable) {
            return verdict::full;
        }
        if (event.body == "[0]") { // does not convert
            unreadable = kept.empty();
            if (!unreadable) {
                return verdict::full;
            }
        }
        convert(event.body);
        if (std::exchange(malformed, false)) {
            return verdict::malformed;
        }
        kept.emplace_back(event.kind == cles::feed_event::gap ? "gap" : event.body);
        return verdict::kept;
    }
    void complete() override {
        ++completed;
        auto batch = std::exchange(kept, {});
        if (unreadable) {
            batch.clear();
        }
        handle(batch);
    }
    void fail(boost::system::error_code code, std::string_view) override { failed = code; }
    void discard() noexcept override { discarded = true; }

    std::function<void(std::string_view)> convert = [](std::string_view) {};
    std::function<void(const std::vector<std::string>&)> handle = [this](const auto& batch) { got.push_back(batch); };
    std::vector<std::string> kept;
    std::vector<std::vector<std::string>> got; // its batches; an empty one: an update that does not convert
    int completed = 0;
    boost::system::error_code failed;
    bool unreadable = false;
    bool malformed = false; // what it reads turns out to be no JSON
    bool discarded = false;
};

cles::limits of_feed(std::size_t values) {
    cles::limits bounds;
    bounds.feed = values;
    return bounds;
}

/// A mailbox whose `pump` a test calls.
struct batch_fixture {
    explicit batch_fixture(std::size_t values = 1024) : mail(std::make_unique<mailbox>(of_feed(values), completions)) {
        mail->set_pump([this] { ++pumps; });
    }
    using mailbox = cles::core::feed_mailbox;
    using batches = std::vector<std::vector<std::string>>;

    bool wait_for_batch(batch_wait& in) { return mail->next(event_ptr{&in}); }
    /// Waits again in each call of the handler.
    void follow(batch_wait& in) {
        in.handle = [this, &in](const std::vector<std::string>& batch) {
            in.got.push_back(batch);
            in.unreadable = false;
            if (wait_for_batch(in)) {
                ++pumps;
            }
        };
        wait_for_batch(in);
    }
    void put(int from, int to, mailbox::hand_over when = mailbox::hand_over::now) {
        for (auto i = from; i <= to; ++i) {
            const auto body = "[" + std::to_string(i) + "]";
            BOOST_TEST(mail->put({.body = body}, when));
        }
    }
    void pump() {
        for (; pumps != 0; --pumps) {
            mail->pump();
        }
    }

    batch_wait w;
    int pumps = 0;
    cles::core::completion_queue completions;
    std::unique_ptr<mailbox> mail;
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

BOOST_AUTO_TEST_CASE(while_a_reader_waits_for_what_is_there_nothing_is_dropped) {
    cles::limits bounds;
    bounds.feed = 2;
    cles::core::feed_mailbox brief{bounds, completions};
    BOOST_TEST(brief.put({.body = "[1]"}));
    BOOST_TEST(brief.next(event_ptr{&w}));
    for (int i = 2; i <= 9; ++i) {
        const auto body = "[" + std::to_string(i) + "]";
        BOOST_TEST(brief.put({.body = body}));
    }
    BOOST_TEST(brief.unfetched() == 9U);
    for (int i = 1; i <= 9; ++i) {
        brief.pump();
        BOOST_TEST(w.text == "[" + std::to_string(i) + "]");
        brief.next(event_ptr{&w});
    }
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

using batch_fixture = feed_mailbox::batch_fixture;
using batch_wait = feed_mailbox::batch_wait;
using hand_over = cles::core::feed_mailbox::hand_over;

BOOST_AUTO_TEST_CASE(a_batch_has_what_has_arrived_until_the_mailbox_is_pumped) {
    batch_fixture f;
    BOOST_TEST(!f.wait_for_batch(f.w));
    f.put(1, 3);
    BOOST_TEST(f.w.completed == 0);
    BOOST_TEST(f.pumps == 1);
    f.pump();
    BOOST_TEST((f.w.got == batch_fixture::batches{{"[1]", "[2]", "[3]"}}));
    BOOST_TEST(!f.mail->has_waiter());
}

BOOST_AUTO_TEST_CASE(a_batch_takes_all_that_has_waited) {
    batch_fixture f;
    f.put(1, 3);
    BOOST_TEST(f.pumps == 0); // nobody waits
    BOOST_TEST(f.wait_for_batch(f.w));
    f.mail->pump();
    BOOST_TEST((f.w.got == batch_fixture::batches{{"[1]", "[2]", "[3]"}}));
}

BOOST_AUTO_TEST_CASE(a_reader_that_waits_again_misses_nothing_although_the_feed_is_short) {
    batch_fixture f{4};
    f.follow(f.w);
    f.put(1, 10); // of one read
    BOOST_TEST((f.w.got == batch_fixture::batches{{"[1]", "[2]", "[3]", "[4]"}, {"[5]", "[6]", "[7]", "[8]"}}));
    f.pump();
    BOOST_TEST(f.w.got.size() == 3U);
    BOOST_TEST((f.w.got.back() == std::vector<std::string>{"[9]", "[10]"}));
}

BOOST_AUTO_TEST_CASE(nor_does_one_that_shares_its_binding) {
    batch_fixture f{4};
    f.follow(f.w);
    f.put(1, 10, hand_over::later);
    BOOST_TEST(f.w.completed == 0);
    f.pump();
    BOOST_TEST(f.w.got.size() == 1U);
    BOOST_TEST(f.w.got.front().size() == 10U);
    BOOST_TEST(f.w.got.front().back() == "[10]");
}

BOOST_AUTO_TEST_CASE(a_reader_of_batches_that_does_not_wait_is_told_what_it_misses) {
    batch_fixture f{4};
    f.put(1, 10);
    f.wait_for_batch(f.w);
    f.mail->pump();
    BOOST_TEST((f.w.got == batch_fixture::batches{{"gap", "[7]", "[8]", "[9]", "[10]"}}));
}

BOOST_AUTO_TEST_CASE(other_events_are_in_the_batch_in_order) {
    batch_fixture f;
    f.follow(f.w);
    f.put(1, 1);
    BOOST_TEST(f.mail->put({.kind = cles::feed_event::gap, .missed = 1}));
    f.put(3, 3);
    f.pump();
    BOOST_TEST((f.w.got == batch_fixture::batches{{"[1]", "gap", "[3]"}}));
}

BOOST_AUTO_TEST_CASE(a_batch_ends_before_an_update_that_does_not_convert) {
    batch_fixture f;
    f.follow(f.w);
    f.put(1, 1);
    f.put(0, 0);
    f.put(2, 3);
    f.pump();
    f.pump();
    BOOST_TEST((f.w.got == batch_fixture::batches{{"[1]"}, {}, {"[2]", "[3]"}}));
}

BOOST_AUTO_TEST_CASE(a_body_that_is_not_json_is_not_in_the_batch) {
    batch_fixture f;
    f.follow(f.w);
    f.put(1, 1);
    BOOST_TEST(!f.mail->put({.body = "{"}));
    f.put(2, 2);
    f.pump();
    BOOST_TEST((f.w.got == batch_fixture::batches{{"[1]", "[2]"}}));
}

BOOST_AUTO_TEST_CASE(a_wait_for_a_batch_is_cancelled_only_while_it_has_nothing) {
    batch_fixture f;
    f.wait_for_batch(f.w);
    f.mail->cancel(&f.w);
    BOOST_TEST((f.w.failed == cles::errc::cancelled));
    BOOST_TEST(!f.mail->has_waiter());

    batch_wait other;
    f.wait_for_batch(other);
    f.put(1, 1);
    f.mail->cancel(&other);
    f.pump();
    BOOST_TEST(!other.failed);
    BOOST_TEST((other.got == batch_fixture::batches{{"[1]"}}));
}

BOOST_AUTO_TEST_CASE(a_handler_of_batches_may_throw) {
    batch_fixture f{2};
    f.follow(f.w);
    const auto wait_again = f.w.handle;
    f.w.handle = [&](const std::vector<std::string>& batch) {
        wait_again(batch);
        throw std::runtime_error("of a handler");
    };
    f.put(1, 2); // a full batch
    BOOST_TEST(f.completions.has_thrown());
    BOOST_CHECK_THROW(f.completions.rethrow(), std::runtime_error);
    f.put(3, 3);
    BOOST_CHECK_THROW(f.mail->pump(), std::runtime_error);
    f.put(4, 4);
    f.w.handle = wait_again;
    f.mail->pump();
    BOOST_TEST((f.w.got == batch_fixture::batches{{"[1]", "[2]"}, {"[3]"}, {"[4]"}}));
}

BOOST_AUTO_TEST_CASE(a_conversion_of_batches_may_throw) {
    batch_fixture f;
    f.follow(f.w);
    f.w.convert = [](std::string_view body) {
        if (body == "[2]") {
            throw 2; // not a std::exception, which would be a failed conversion
        }
    };
    f.put(1, 3);
    BOOST_TEST(f.completions.has_thrown());
    BOOST_CHECK_THROW(f.completions.rethrow(), int);
    f.pump();
    BOOST_TEST((f.w.got == batch_fixture::batches{{"[1]", "[3]"}}));

    f.put(1, 3, hand_over::later);
    BOOST_CHECK_THROW(f.mail->pump(), int);
    f.pump();
    f.pump();
    BOOST_TEST((f.w.got == batch_fixture::batches{{"[1]", "[3]"}, {"[1]", "[3]"}}));
}

BOOST_AUTO_TEST_CASE(what_a_conversion_lets_in_is_delivered_without_another_update) {
    for (const bool is_malformed : {false, true}) {
        batch_fixture f;
        f.follow(f.w);
        f.w.convert = [&](std::string_view body) { // it runs the executor, on which an update arrives, and `pump`
            if (body == "[1]") {
                f.put(2, 2);
                f.pump();
                f.w.malformed = is_malformed;
                if (!is_malformed) {
                    throw 1;
                }
            }
        };
        BOOST_TEST(f.mail->put({.body = "[1]"}) != is_malformed);
        BOOST_TEST(f.completions.has_thrown() != is_malformed);
        if (f.completions.has_thrown()) {
            BOOST_CHECK_THROW(f.completions.rethrow(), int);
        }
        BOOST_TEST(f.pumps == 1);
        f.pump();
        BOOST_TEST((f.w.got == batch_fixture::batches{{"[2]"}}));
    }
}

BOOST_AUTO_TEST_CASE(a_handler_of_batches_may_close_or_destroy_its_feed) {
    for (const bool destroy : {false, true}) {
        batch_fixture f{2};
        f.wait_for_batch(f.w);
        f.w.handle = [&](const std::vector<std::string>& batch) {
            f.w.got.push_back(batch);
            destroy ? f.mail.reset() : static_cast<void>(f.mail->close());
        };
        f.put(1, 2);
        BOOST_TEST((f.w.got == batch_fixture::batches{{"[1]", "[2]"}}));
        BOOST_TEST(!f.w.discarded);
    }
}

BOOST_AUTO_TEST_CASE(a_conversion_of_batches_may_close_or_destroy_its_feed) {
    for (const bool destroy : {false, true}) {
        batch_fixture f;
        f.wait_for_batch(f.w);
        f.put(1, 1);
        f.w.convert = [&](std::string_view) { destroy ? f.mail.reset() : static_cast<void>(f.mail->close()); };
        f.put(2, 2);
        BOOST_TEST((f.w.failed == cles::errc::cancelled));
        BOOST_TEST(f.w.completed == 0);
        BOOST_TEST(!f.w.discarded);
    }
}

BOOST_AUTO_TEST_CASE(while_a_batch_is_read_its_feed_is_busy_and_keeps_the_order) {
    batch_fixture f;
    f.follow(f.w);
    f.w.convert = [&](std::string_view body) {
        if (body == "[1]") { // as if it had run the executor
            BOOST_TEST(f.mail->has_waiter());
            f.put(2, 2);
            BOOST_TEST(!f.mail->pump());
        }
    };
    f.put(1, 1);
    f.put(3, 3);
    f.pumps = 1; // what was posted before has run inside the conversion
    f.pump();
    BOOST_TEST((f.w.got == batch_fixture::batches{{"[1]", "[2]", "[3]"}}));
}

BOOST_AUTO_TEST_CASE(a_closed_feed_gives_back_a_wait_for_a_batch) {
    batch_fixture f;
    f.wait_for_batch(f.w);
    f.put(1, 1);
    BOOST_TEST((f.mail->close().get() == &f.w));
    f.pump();
    BOOST_TEST(f.w.completed == 0);
}

BOOST_AUTO_TEST_SUITE_END()
