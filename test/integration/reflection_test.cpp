// SPDX-License-Identifier: BSL-1.0
// What a node sends by datagram to unverified source addresses.

#include <cles/link.hpp>
#include <cles/service.hpp>

#include "support/run_until.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

BOOST_AUTO_TEST_SUITE(reflection)

using namespace cles::test;
namespace asio = boost::asio;

namespace {

/// A link from another host, which tests do not have.
class far_link final : public cles::link {
  public:
    explicit far_link(std::string address) {
        who_.transport = "udp";
        who_.address = std::move(address);
    }
    void start(std::shared_ptr<cles::link_events> owner) override { owner_ = std::move(owner); }
    std::string& output() override { return output_; }
    [[nodiscard]] std::size_t datagram() const noexcept override { return 1200; }
    void flush() override {
        bytes += output_.size();
        output_.clear();
    }
    [[nodiscard]] std::size_t unsent() const noexcept override { return output_.size(); }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return bytes; }
    [[nodiscard]] std::uint64_t received() const noexcept override { return 0; }
    void pause(bool) override {}
    void finish() override {}
    void close() override { owner_.reset(); }
    [[nodiscard]] const cles::identity& peer() const noexcept override { return who_; }

    void say(std::string_view line) {
        const auto owner = owner_;
        owner->on_line(line);
        owner->on_batch();
    }

    std::size_t bytes = 0;

  private:
    std::string output_;
    std::shared_ptr<cles::link_events> owner_;
    cles::identity who_;
};

std::function<void(cles::link_ptr)>& door() {
    static std::function<void(cles::link_ptr)> callback;
    return callback;
}

class far_acceptor final : public cles::acceptor {
  public:
    [[nodiscard]] cles::url local() const override { return cles::parse_url("far://here:1"); }
    void start(std::function<void(cles::link_ptr)> on_link) override { door() = std::move(on_link); }
    void close() override { door() = nullptr; }
    ~far_acceptor() override { door() = nullptr; }
};

class far_transport final : public cles::link_transport {
  public:
    [[nodiscard]] bool is_exposed(const cles::url&) const override { return true; }
    std::unique_ptr<cles::acceptor> listen(const asio::any_io_executor&, const cles::url&,
                                           const cles::limits&) override {
        return std::make_unique<far_acceptor>();
    }
    std::function<void()> dial(const asio::any_io_executor&, const cles::url&, const cles::limits&,
                               cles::dial_callback) override {
        return [] {};
    }
};

struct fixture {
    explicit fixture(std::vector<std::string> networks = {}) {
        cles::register_transport("far", std::make_unique<far_transport>());
        car = std::make_unique<cles::service>(
            io, cles::service_options{
                    .name = "car1", .listen = {"far://here:1"}, .insecure = true, .networks = std::move(networks)});
        car->on_pull("much", [] { return std::string(1000, 'x'); });
        car->on_bind("much");
    }
    std::shared_ptr<far_link> arrive(const std::string& address) {
        auto made = std::make_shared<far_link>(address);
        door()(made);
        return made;
    }

    asio::io_context io;
    std::unique_ptr<cles::service> car;
};

struct trusting : fixture {
    trusting() : fixture({"192.0.2.0/24", "2001:db8::/32"}) {}
};

} // namespace

// This takes much less than a second.
BOOST_FIXTURE_TEST_CASE(an_unverified_address_gets_less_than_64_KiB_from_all_its_ports, fixture) {
    const auto one = arrive("udp://192.0.2.7:4000");
    const auto two = arrive("udp://192.0.2.7:4001");
    for (int i = 0; i < 200; ++i) {
        one->say("PULL car1:much");
        two->say("PULL car1:much");
    }
    BOOST_TEST(one->bytes + two->bytes < 65536U);
    BOOST_TEST(one->bytes > 1000U);
    const auto other = arrive("udp://192.0.2.8:4000");
    other->say("PULL car1:much");
    BOOST_TEST(other->bytes > 1000U);
    const auto metrics = car->request("PULL self:cles/metrics");
    BOOST_TEST(metrics.find("\"datagrams_withheld\":0,") == std::string::npos, metrics);
}

BOOST_FIXTURE_TEST_CASE(updates_count_too, fixture) {
    const auto one = arrive("udp://[2001:db8::7]:4000");
    one->say("BIND car1:much keep=1000");
    for (int i = 0; i < 200; ++i) {
        car->update("much", std::string(1000, 'x'));
    }
    run_ready(io); // all at once, so that little time passes
    BOOST_TEST(one->bytes > 10000U);
    BOOST_TEST(one->bytes < 65536U);
}

BOOST_FIXTURE_TEST_CASE(configured_networks_get_what_they_ask_for, trusting) {
    for (const auto* address : {"udp://192.0.2.7:4000", "udp://[2001:db8::7]:4000"}) {
        const auto known = arrive(address);
        for (int i = 0; i < 200; ++i) {
            known->say("PULL car1:much");
        }
        BOOST_TEST(known->bytes > 200U * 1000U);
    }
    const auto stranger = arrive("udp://198.51.100.1:4000");
    for (int i = 0; i < 200; ++i) {
        stranger->say("PULL car1:much");
    }
    BOOST_TEST(stranger->bytes < 65536U);
}

BOOST_AUTO_TEST_SUITE_END()
