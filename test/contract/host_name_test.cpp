// SPDX-License-Identifier: BSL-1.0
// Host names are looked up beside the event loop and each other, and a host may have several addresses.

#include "support/data_test_case.hpp"
#include "support/link_pair.hpp"
#include "support/run_until.hpp"
#include "support/silent_listener.hpp"
#include "support/test_suite.hpp"
#include "transport/datagram_codec.hpp"
#include "transport/udp.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <iterator>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <dlfcn.h>
#include <netdb.h>

namespace {

/// Replaces the system's resolver: names that end in ".slow.test" wait until they are released; others in ".test"
/// resolve to this host, and those that end in ".both.test" to its addresses 127.0.0.2 and 127.0.0.1.
class resolver_stand_in {
  public:
    static resolver_stand_in& get() {
        static auto& instance = *new resolver_stand_in; // threads may outlive static objects
        return instance;
    }
    void hold() {
        const std::lock_guard lock{mutex_};
        open_ = false;
    }
    void let_go() {
        const std::lock_guard lock{mutex_};
        open_ = true;
        changed_.notify_all();
    }
    void wait() {
        std::unique_lock lock{mutex_};
        changed_.wait(lock, [this] { return open_; });
    }

  private:
    std::mutex mutex_;
    std::condition_variable changed_;
    bool open_ = true;
};

} // namespace

// Replaces the C library's function in the whole program.
extern "C" int getaddrinfo(const char* node, const char* service, const addrinfo* hints, addrinfo** result) {
    using function = int (*)(const char*, const char*, const addrinfo*, addrinfo**);
    static const auto real = reinterpret_cast<function>(::dlsym(RTLD_NEXT, "getaddrinfo"));
    const std::string_view name = node == nullptr ? "" : node;
    if (!name.ends_with(".test")) {
        return real(node, service, hints, result);
    }
    if (name.ends_with(".slow.test")) {
        resolver_stand_in::get().wait();
    }
    if (name.starts_with("nobody.")) {
        return EAI_NONAME;
    }
    const int failed = real("127.0.0.1", service, hints, result);
    addrinfo* first = nullptr;
    if (failed == 0 && name.ends_with(".both.test") && real("127.0.0.2", service, hints, &first) == 0) {
        first->ai_next = std::exchange(*result, first);
    }
    return failed;
}

CLES_TEST_SUITE(host_name)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;
using asio::ip::udp;

const std::array schemes{std::string{"tcp"}, std::string{"udp"}};

std::ptrdiff_t threads() {
    return std::distance(std::filesystem::directory_iterator{"/proc/self/task"}, std::filesystem::directory_iterator{});
}

/// While it exists, slow names are slow.
struct slowness {
    slowness() { resolver_stand_in::get().hold(); }
    ~slowness() { resolver_stand_in::get().let_go(); }
};

struct dialled {
    dialled(asio::io_context& io, const std::string& url, std::chrono::milliseconds within = 20s)
        : give_up(cles::find_transport(cles::parse_url(url).scheme)
                      ->dial(io.get_executor(), cles::parse_url(url), {.connect = within},
                             [this](boost::system::error_code failed, cles::link_ptr made) {
                                 ++calls;
                                 code = failed;
                                 link = std::move(made);
                             })) {}
    ~dialled() {
        if (link) {
            link->close();
        }
    }

    int calls = 0;
    boost::system::error_code code;
    cles::link_ptr link;
    std::function<void()> give_up;
};

CLES_DATA_TEST_CASE(a_name_leads_to_its_host, schemes, scheme) {
    asio::io_context io;
    auto at = cles::find_transport(scheme)->listen(io.get_executor(), cles::parse_url(scheme + "://127.0.0.1:0"), {});
    dialled one{io, scheme + "://car1.test:" + std::to_string(at->local().port)};
    run_until(io, [&] { return one.calls != 0; });
    BOOST_TEST(!one.code);
    BOOST_TEST(one.link->peer().address == to_string(at->local()));
}

CLES_DATA_TEST_CASE(an_unknown_name_is_an_error, schemes, scheme) {
    asio::io_context io;
    dialled one{io, scheme + "://nobody.test:4000"};
    run_until(io, [&] { return one.calls != 0; });
    BOOST_TEST((one.code == asio::error::host_not_found));
}

CLES_DATA_TEST_CASE(while_a_name_is_resolved_the_loop_runs_and_the_time_is_bounded, schemes, scheme) {
    asio::io_context io;
    const slowness names;
    dialled one{io, scheme + "://car1.slow.test:4000", 100ms};
    int turns = 0;
    asio::steady_timer timer{io};
    const std::function<void(boost::system::error_code)> turn = [&](boost::system::error_code code) {
        if (!code && one.calls == 0) {
            ++turns;
            timer.expires_after(1ms);
            timer.async_wait(turn);
        }
    };
    turn({});
    run_until(io, [&] { return one.calls != 0; });
    BOOST_TEST((one.code == boost::system::errc::timed_out));
    BOOST_TEST(one.code.message() == "the name of its host could not be looked up in time");
    BOOST_TEST(turns > 2);
}

CLES_DATA_TEST_CASE(a_slow_name_delays_no_other, schemes, scheme) {
    asio::io_context io;
    auto at = cles::find_transport(scheme)->listen(io.get_executor(), cles::parse_url(scheme + "://127.0.0.1:0"), {});
    const slowness names;
    dialled slow{io, scheme + "://car1.slow.test:4000"};
    dialled one{io, scheme + "://car1.test:" + std::to_string(at->local().port)};
    run_until(io, [&] { return one.calls != 0; });
    BOOST_TEST(!one.code);
    BOOST_TEST(slow.calls == 0);
    slow.give_up();
}

CLES_DATA_TEST_CASE(nothing_waits_for_a_lookup_that_was_given_up, schemes, scheme) {
    auto io = std::make_unique<asio::io_context>();
    const slowness names;
    dialled one{*io, scheme + "://car1.slow.test:4000"};
    dialled next{*io, scheme + "://car2.slow.test:4000"};
    run_ready(*io);
    one.give_up();
    next.give_up();
    run_ready(*io);
    io->restart();
    io->run(); // ends
    BOOST_TEST(one.calls == 0);
    BOOST_TEST(next.calls == 0);
    dialled last{*io, scheme + "://car3.slow.test:4000"};
    for (auto* each : {&one, &next, &last}) {
        each->give_up = nullptr; // it has timers of the context
    }
    io.reset(); // while a name is being looked up
    BOOST_TEST(last.calls == 0);
}

CLES_DATA_TEST_CASE(addresses_start_no_thread_and_those_of_names_end, schemes, scheme) {
    asio::io_context io;
    auto at = cles::find_transport(scheme)->listen(io.get_executor(), cles::parse_url(scheme + "://127.0.0.1:0"), {});
    const auto port = std::to_string(at->local().port);
    const auto before = threads(); // those of other tests may end meanwhile
    for (const auto* host : {"127.0.0.1", "localhost"}) {
        dialled one{io, scheme + "://" + host + ":" + port};
        run_until(io, [&] { return one.calls != 0; });
        BOOST_TEST(!one.code, host);
        BOOST_TEST(threads() <= before);
    }
    for (const auto* host : {"car1.test", "car2.test", "nobody.test"}) {
        dialled one{io, scheme + "://" + host + ":" + port};
        run_until(io, [&] { return one.calls != 0 && threads() <= before; });
    }
}

BOOST_AUTO_TEST_CASE(a_silent_address_is_left_for_the_next) {
    asio::io_context io;
    const silent_listener silent{io, asio::ip::make_address_v4("127.0.0.2")};
    const auto port = std::to_string(silent.where().port());
    auto at = cles::find_transport("tcp")->listen(io.get_executor(), cles::parse_url("tcp://127.0.0.1:" + port), {});
    dialled one{io, "tcp://car1.both.test:" + port};
    run_until(io, [&] { return one.calls != 0; });
    BOOST_TEST(!one.code);
    BOOST_TEST(one.link->peer().address == "tcp://127.0.0.1:" + port);
}

/// Two sockets with one port, at both addresses of a host.
struct two_addresses {
    explicit two_addresses(asio::io_context& io)
        : silent(io, {asio::ip::make_address_v4("127.0.0.2"), 0}),
          good(io, {asio::ip::make_address_v4("127.0.0.1"), silent.local_endpoint().port()}) {
        silent.non_blocking(true);
        good.non_blocking(true);
    }
    [[nodiscard]] std::string url() const {
        return "udp://car1.both.test:" + std::to_string(good.local_endpoint().port());
    }
    /// What has arrived.
    std::vector<std::string> read(udp::socket& from) {
        std::vector<std::string> all;
        for (;;) {
            std::array<char, 2000> text{};
            boost::system::error_code code;
            const auto count = from.receive_from(asio::buffer(text), sender, 0, code);
            if (code) {
                return all;
            }
            all.emplace_back(text.data(), count);
        }
    }

    udp::socket silent;
    udp::socket good;
    udp::endpoint sender;
};

BOOST_AUTO_TEST_CASE(an_address_is_asked_before_it_gets_requests_by_datagram) {
    const std::string question = "PULL self:cles id=9007199254740991\n";
    asio::io_context io;
    two_addresses host{io};
    dialled one{io, host.url()};
    std::vector<std::string> asked;
    run_until(io, [&] {
        asked = host.read(host.good);
        return !asked.empty();
    });
    BOOST_TEST(asked.front() == question);
    host.good.send_to(asio::buffer(std::string{"id=1 {}\n"}), host.sender); // not the answer
    run_ready(io);
    BOOST_TEST(one.calls == 0);
    host.good.send_to(asio::buffer(std::string{R"(id=9007199254740991 {"error":"denied"})"}), host.sender);
    run_until(io, [&] { return one.calls != 0; });
    BOOST_REQUIRE(one.link != nullptr);
    BOOST_TEST(one.link->peer().address == "udp://127.0.0.1:" + std::to_string(host.good.local_endpoint().port()));
    host.read(host.good);
    const auto events = std::make_shared<link_recorder>();
    one.link->start(events);
    one.link->output() = "PUSH car1:poke id=1\n";
    one.link->flush();
    host.good.send_to(asio::buffer(std::string{"id=1 {}"}), host.sender);
    run_until(io, [&] { return !events->lines.empty(); });
    BOOST_TEST(events->lines.front() == "id=1 {}");
    BOOST_TEST((host.read(host.good) == std::vector<std::string>{"PUSH car1:poke id=1\n"}));
    const auto others = host.read(host.silent);
    BOOST_TEST(!others.empty());
    for (const auto& each : others) {
        BOOST_TEST(each == question);
    }

    dialled again{io, host.url()};
    run_until(io, [&] { return !host.read(host.good).empty(); });
    BOOST_TEST(host.read(host.silent).empty()); // it is not the first any more
    again.give_up();
}

BOOST_AUTO_TEST_CASE(if_no_address_answers_a_datagram_the_link_fails) {
    asio::io_context io;
    two_addresses host{io};
    dialled one{io, host.url(), 600ms};
    run_until(io, [&] { return one.calls != 0; });
    BOOST_TEST((one.code == boost::system::errc::timed_out));
    BOOST_TEST(one.code.message() == "none of the addresses of its host answered in time");
    BOOST_TEST(host.read(host.good).size() > 0U);
}

/// Seals nothing, and begins a session with one address only.
class session_codec final : public cles::transport::datagram_codec {
  public:
    session_codec(asio::io_context& io, std::vector<std::string>& log) : io_(io), log_(log) {}

    void start(carrier& owner) override { owner_ = &owner; }
    void stop() override { owner_ = nullptr; }
    void receive(const endpoint&, std::string_view) override {}
    void send(const cles::transport::datagram_origin& to, std::string_view line) override {
        log_.push_back(to.at.address().to_string() + ": " + std::string{line});
    }
    void contact(const cles::transport::datagram_origin& with) override {
        log_.push_back(with.at.address().to_string() + ": hello");
        if (with.at.address().to_string() == "127.0.0.1") {
            asio::post(io_, [this, with] { owner_->on_established(with, 7); });
        }
    }
    void check_peer(const cles::transport::datagram_origin&, cles::time_point) override {}
    void release(const cles::transport::datagram_origin&) override {}
    [[nodiscard]] std::string name_of(std::uint32_t) const override { return "car1"; }

  private:
    asio::io_context& io_;
    std::vector<std::string>& log_;
    carrier* owner_ = nullptr;
};

BOOST_AUTO_TEST_CASE(with_security_the_session_is_the_answer) {
    asio::io_context io;
    std::vector<std::string> log;
    cles::link_ptr made;
    const auto give_up = cles::transport::dial_udp(
        io.get_executor(), cles::parse_url("udp://car1.both.test:4000"), {},
        [&](boost::system::error_code, cles::link_ptr link) { made = std::move(link); },
        [&](boost::system::error_code&) {
            return cles::transport::sealed_peer{
                .codec = std::make_unique<session_codec>(io, log), .member = 1, .name = "car1"};
        });
    run_until(io, [&] { return made != nullptr; });
    BOOST_TEST(made->epoch() == "00000007");
    BOOST_TEST(made->peer().address == "udp://127.0.0.1:4000");
    BOOST_TEST(log.front() == "127.0.0.2: hello");
    BOOST_TEST(log.back() == "127.0.0.1: hello");
    made->close();
}

BOOST_AUTO_TEST_SUITE_END()
