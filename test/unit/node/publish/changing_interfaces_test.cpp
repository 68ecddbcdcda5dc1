// SPDX-License-Identifier: BSL-1.0
// A node in its multicast group while the interfaces of its host change.
#include <cles/link.hpp>
#include <cles/log.hpp>

#include "node/publish/group_interfaces.hpp"
#include "node/publish/multicast_group.hpp"
#include "port/environment.hpp"
#include "support/group_recorder.hpp"
#include "support/session_fixture.hpp"

#include <boost/system/system_error.hpp>
#include <boost/test/unit_test.hpp>

#include <cerrno>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace changing_interfaces {
namespace {

using interface = cles::core::network_interface;
using recorder = cles::test::group_recorder;
using texts = std::vector<std::string>;

interface card(const std::string& name, int index, std::uint32_t address) {
    return {.name = name, .index = index, .address = address, .up = true, .running = true, .multicast = true};
}

const auto loopback = interface {
    .name = "lo", .index = 1, .address = 0x7F000001, .loopback = true, .up = true, .running = true
};

/// A host whose interfaces the test changes.
class changing_host final : public cles::core::environment {
  public:
    explicit changing_host(const cles::core::clock& time) : time_(time) {}

    [[nodiscard]] cles::time_point now() const override { return time_.now(); }
    std::uint32_t random() override { return 7; }
    void post(std::shared_ptr<cles::core::task>) override {}
    void start_timer(std::function<void()>) override {}
    void set_timer(cles::time_point) override {}
    void stop_timer() override {}
    [[nodiscard]] bool has_transport(std::string_view) const override { return false; }
    [[nodiscard]] bool is_exposed(const cles::url&) const override { return false; }
    std::unique_ptr<cles::acceptor> listen(const cles::url&, const cles::limits&) override { return nullptr; }
    std::function<void()> dial(const cles::url&, std::string_view, const cles::limits&, cles::dial_callback) override {
        return {};
    }
    [[nodiscard]] std::string local_scope() const override { return {}; }
    [[nodiscard]] bool is_open(const std::string&) const override { return false; }

    std::vector<interface> interfaces() override { return all; }
    interface find_interface(const std::string& name) override {
        for (const auto& each : all) {
            if (each.name == name && each.address != 0) {
                return each;
            }
        }
        throw boost::system::system_error{ENODEV, boost::system::system_category()};
    }
    std::shared_ptr<void> watch_interfaces(std::function<void()> on_change) override {
        changed = std::move(on_change);
        return std::make_shared<int>(0);
    }
    std::shared_ptr<cles::core::group_port> join(const interface& by, const cles::multicast_options&) override {
        if (refuses) {
            throw boost::system::system_error{ENOBUFS, boost::system::system_category()};
        }
        last_port_ = static_cast<std::uint16_t>(last_port_ + 1);
        joined = std::make_shared<recorder>(cles::core::group_source{.address = by.address, .port = last_port_});
        return joined;
    }

    std::vector<interface> all{loopback};
    std::function<void()> changed;
    std::shared_ptr<recorder> joined; // the last one
    bool refuses = false;

  private:
    const cles::core::clock& time_;
    std::uint16_t last_port_ = 4000;
};

class presence final : public cles::core::announcement_listener {
  public:
    void on_solicitation(bool, cles::time_point) override {}
    void on_announcement(cles::core::heard_announcement, cles::time_point) override {}
    void on_interfaces_changed(cles::time_point) override { ++changes; }

    int changes = 0;
};

cles::multicast_options on(std::string interfaces, bool required = true) {
    cles::multicast_options where{.interface = std::move(interfaces)};
    where.required = required;
    return where;
}

void check(const texts& found, const texts& expected) {
    BOOST_TEST(found == expected, boost::test_tools::per_element());
}

struct fixture {
    void join(const cles::multicast_options& where, bool insecure = true) {
        group.join(host, where, insecure);
        group.start();
        group.set_listener(&listener);
        logged.clear();
    }
    void change(std::vector<interface> all) {
        host.all = std::move(all);
        host.joined.reset();
        host.changed();
        node.pass(cles::core::group_interfaces::settling);
    }

    texts logged;
    cles::test::test_node node{
        {}, {}, [this](cles::log_level, const cles::log_entry& entry) { logged.emplace_back(entry.text); }};
    changing_host host{node.clock};
    presence listener;
    cles::core::multicast_group group{node.host, 1};
};

} // namespace
} // namespace changing_interfaces

BOOST_FIXTURE_TEST_SUITE(changing_interfaces, fixture)

BOOST_AUTO_TEST_CASE(an_interface_that_comes_is_joined_asked_and_announced) {
    cles::core::group_feed feed{{}, node.host->completions, "all", "speed"};
    join(on("auto"));
    group.feeds().add(feed, node.clock.now());
    change({loopback, card("eth0", 2, 0x0A500001)});
    BOOST_REQUIRE(host.joined);
    check(host.joined->take(), {"BIND all:cles", "BIND all:speed lease=10000"});
    BOOST_TEST(group.interfaces() == "lo, eth0");
    BOOST_TEST(listener.changes == 1);
    check(logged, {"car1 has joined 239.255.25.37:25370 on eth0, sending from 10.80.0.1:4002"});
    group.feeds().remove(feed);
}

BOOST_AUTO_TEST_CASE(a_new_address_is_a_new_source) {
    join(on("eth0,lo", false)); // eth0 is not there yet
    change({loopback, card("eth0", 2, 0x0A500001)});
    change({loopback, card("eth0", 2, 0x0A50004D)});
    BOOST_REQUIRE(group.ports().size() == 2U);
    BOOST_TEST(to_text(group.ports().back()->source()) == "10.80.0.77:4003");
    BOOST_TEST(!group.is_own({.address = 0x0A500001, .port = 4002}));
    BOOST_TEST(listener.changes == 2);
    check({logged.begin() + 1, logged.end()},
          {"car1 has left 239.255.25.37:25370 on eth0, which does not have 10.80.0.1 any more",
           "car1 has joined 239.255.25.37:25370 on eth0, sending from 10.80.0.77:4003"});
}

BOOST_AUTO_TEST_CASE(changes_that_concern_others_do_nothing) {
    join(on("lo"));
    change({loopback, card("eth0", 2, 0x0A500001)});
    BOOST_TEST(!host.joined);
    BOOST_TEST(listener.changes == 0);
    BOOST_TEST(logged.empty());
}

BOOST_AUTO_TEST_CASE(without_any_interface_a_group_that_is_not_required_waits_for_one) {
    host.all.clear();
    BOOST_CHECK_THROW(join(on("auto")), cles::error);
    join(on("auto", false));
    BOOST_TEST(group.ports().empty());
    BOOST_TEST(!group.send("BIND all:cles\n"));
    change({loopback});
    BOOST_TEST(group.interfaces() == "lo");
    change({});
    BOOST_TEST(group.ports().empty());
}

BOOST_AUTO_TEST_CASE(an_interface_that_cannot_be_joined_is_tried_again_and_logged_once) {
    join(on("auto"));
    host.refuses = true;
    change({loopback, card("eth0", 2, 0x0A500001)});
    node.pass(cles::core::group_interfaces::first_retry);
    BOOST_TEST(logged.size() == 1U);
    host.refuses = false;
    node.pass(2 * cles::core::group_interfaces::first_retry);
    BOOST_TEST(group.interfaces() == "lo, eth0");
    BOOST_TEST(listener.changes == 1);
}

BOOST_AUTO_TEST_CASE(one_that_cannot_be_joined_at_the_start_is_tried_again_too) {
    host.all = {loopback, card("eth0", 2, 0x0A500001)};
    host.refuses = true;
    join(on("eth0", false));
    node.pass(cles::core::group_interfaces::first_retry);
    BOOST_TEST(logged.empty()); // nothing new
    host.refuses = false;
    node.pass(2 * cles::core::group_interfaces::first_retry);
    BOOST_TEST(group.interfaces() == "eth0");
}

BOOST_AUTO_TEST_CASE(an_interface_that_others_can_reach_is_not_joined_without_leave) {
    join(on("auto"), false);
    change({loopback, card("eth0", 2, 0x0A500001)});
    BOOST_TEST(group.interfaces() == "lo");
    BOOST_REQUIRE(logged.size() == 1U);
    BOOST_TEST(logged.front().starts_with("multicast on 'eth0' can be reached from other hosts"), logged.front());
}

BOOST_AUTO_TEST_CASE(after_the_end_nothing_is_joined) {
    join(on("auto"));
    host.all = {loopback, card("eth0", 2, 0x0A500001)};
    host.changed();
    group.stop();
    node.pass(cles::core::group_interfaces::settling);
    host.changed(); // which had been on its way
    BOOST_TEST(group.interfaces() == "lo");
}

BOOST_AUTO_TEST_SUITE_END()
