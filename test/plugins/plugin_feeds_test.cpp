// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_feeds.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace plugin_feeds {
namespace {

using cles::job_feed;

// A feed that counts how often it is closed.
class counted_feed final : public cles::detail::job_feed_control {
  public:
    explicit counted_feed(int& closed) : closed_(closed) {}
    void next(cles::event_callback) override {}
    void close() noexcept override { ++closed_; }

  private:
    int& closed_;
};

struct fixture {
    job_feed made() { return job_feed{std::make_shared<counted_feed>(closed)}; }

    int closed = 0;
    cles::runtime::plugin_feeds feeds;
};

} // namespace
} // namespace plugin_feeds

BOOST_FIXTURE_TEST_SUITE(plugin_feeds, fixture)

BOOST_AUTO_TEST_CASE(a_feed_is_unbound_when_it_is_removed_and_its_handle_is_not_used_again) {
    const auto first = feeds.add({.feed = made()});
    BOOST_TEST(first != 0U);
    BOOST_TEST(feeds.find(first).feed.is_open());
    BOOST_TEST(closed == 0);
    feeds.remove(first);
    BOOST_TEST(closed == 1);
    BOOST_TEST(!feeds.find(first).feed.is_open());
    feeds.remove(first);
    BOOST_TEST(closed == 1);
    BOOST_TEST(feeds.add({.feed = made()}) > first);
}

BOOST_AUTO_TEST_CASE(a_reader_keeps_its_feed) {
    const auto id = feeds.add({.feed = made()});
    {
        const auto found = feeds.find(id);
        feeds.remove(id);
        BOOST_TEST(closed == 0);
        BOOST_TEST(found.feed.is_open());
    }
    BOOST_TEST(closed == 1);
}

BOOST_AUTO_TEST_CASE(why_there_is_none_is_kept) {
    const auto id = feeds.add({.feed = {}, .why = cles::errc::failed, .words = "no feeds here"});
    BOOST_TEST((feeds.find(id).why == cles::errc::failed));
    BOOST_TEST(feeds.find(id).words == std::string{"no feeds here"});
    BOOST_TEST((feeds.find(id + 1).why == cles::errc::cancelled));
}

BOOST_AUTO_TEST_CASE(there_are_so_many_feeds_and_no_more) {
    std::vector<std::uint64_t> all;
    for (std::size_t i = 0; i < feeds.max_open; ++i) {
        all.push_back(feeds.add({.feed = made()}));
    }
    const auto more = feeds.add({.feed = made()});
    BOOST_TEST(more != 0U);
    BOOST_TEST(!feeds.find(more).feed.is_open());
    BOOST_TEST(closed == 1);
    feeds.remove(all.front());
    BOOST_TEST(feeds.find(feeds.add({.feed = made()})).feed.is_open());
}

BOOST_AUTO_TEST_SUITE_END()
