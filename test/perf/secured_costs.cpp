// SPDX-License-Identifier: BSL-1.0
// What security adds to a PULL by datagrams, and to an UPDATE by multicast, against the time of the cryptography alone.
// Both ends are in one thread that never waits, so the waking of cores, which takes longer than everything else, is not
// in the figures. What is compared alternates, so that other load of the machine affects all of it alike.
//
//   cles_perf_secured_costs [SLACK]
//
// Fails if security adds more than its bound. SLACK multiplies what is permitted beyond the cryptography; 1 without it.
#include <cles/feed.hpp>
#include <cles/security.hpp>
#include <cles/service.hpp>

#include "../support/group_address.hpp"
#include "fleet_folder.hpp"
#include "scripted_client.hpp"
#include "security/datagrams/noise_kk.hpp"
#include "security/keys/signed_text.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace {

using steady = std::chrono::steady_clock;

constexpr std::size_t warm_up = 500;
constexpr std::size_t counted = 4'000;

double in_us(steady::duration d) { return std::chrono::duration<double, std::micro>(d).count(); }

/// The times of one operation.
class recording {
  public:
    template <class Operation>
    void time(Operation&& operation) {
        const auto begun = steady::now();
        operation();
        all_.push_back(in_us(steady::now() - begun));
    }
    [[nodiscard]] double median() {
        const auto first = all_.begin() + warm_up;
        const auto middle = first + static_cast<std::ptrdiff_t>((all_.size() - warm_up) / 2);
        std::nth_element(first, middle, all_.end());
        return *middle;
    }

  private:
    std::vector<double> all_;
};

/// Two nodes, each with a context of its own: on one, they would share a socket of the group.
class two_nodes {
  public:
    two_nodes(const fleet_folder* keys, const cles::task_info& noun) {
        const auto where = cles::test::fresh_group();
        const auto options = [&](const char* name) {
            cles::service_options made{.name = name, .listen = {"udp://127.0.0.1:0"}, .multicast = where};
            if (keys != nullptr) {
                made.listen.emplace_back("tls://127.0.0.1:0");
                made.security = cles::secured(keys->of(name));
            }
            return made;
        };
        car1_ = std::make_unique<cles::service>(io1_, options("car1"));
        car1_->on_pull("pose", [] { return localization{}; });
        car1_->on_bind("pose", noun);
        auto second = options("car2");
        second.peers.emplace("car1", car1_->endpoints().front());
        car2_ = std::make_unique<cles::service>(io2_, std::move(second));
        cles::bind_options by_group;
        by_group.multicast();
        car2_->async_bind<cles::json_text>("car1:pose", by_group, [this](boost::system::error_code code, auto feed) {
            check(code);
            feed_ = std::move(feed);
            receive();
        });
        const auto end = steady::now() + std::chrono::seconds{30};
        while (received_ < 10) { // the first ones may be lost, until a session is open
            if (steady::now() > end) {
                throw std::runtime_error("no update has arrived");
            }
            car1_->update("pose", value_);
            for (int i = 0; i < 50; ++i) {
                io1_.run_one_for(std::chrono::microseconds{100});
                io2_.run_one_for(std::chrono::microseconds{100});
            }
        }
    }

    void pull() {
        bool done = false;
        car2_->async_request("PULL car1:pose", [&](boost::system::error_code code, const cles::json_text&) {
            check(code);
            done = true;
        });
        poll_until([&] { return done; });
    }
    void update() {
        const auto before = received_;
        value_.utc += 0.001;
        car1_->update("pose", value_);
        poll_until([&] { return received_ != before; });
    }

  private:
    static void check(boost::system::error_code code) {
        if (code) {
            throw std::runtime_error(code.message());
        }
    }
    void receive() {
        feed_.async_next([this](boost::system::error_code code, const auto& event) {
            check(code);
            received_ += event.kind == cles::feed_event::update ? 1 : 0;
            receive();
        });
    }
    template <class Condition>
    void poll_until(Condition&& holds) {
        const auto end = steady::now() + std::chrono::seconds{10};
        for (int turn = 0; !holds(); ++turn) {
            io1_.poll();
            io2_.poll();
            if (turn % 1024 == 1023 && steady::now() > end) {
                throw std::runtime_error("a message was lost");
            }
        }
    }

    boost::asio::io_context io1_{1};
    boost::asio::io_context io2_{1};
    std::unique_ptr<cles::service> car1_;
    std::unique_ptr<cles::service> car2_;
    cles::feed<cles::json_text> feed_;
    localization value_{};
    std::uint64_t received_ = 0;
};

/// To seal a line like those that are exchanged, or to open one.
class sealing {
  public:
    void seal() { cles::security::noise_seal(key_.data(), ++counter_, head_, line_, sealed_.data()); }
    void open() {
        if (!cles::security::noise_open(key_.data(), counter_, head_, sealed_, line_.data())) {
            throw std::runtime_error("cannot open what was sealed");
        }
    }

  private:
    std::array<std::uint8_t, 32> key_{1, 2, 3};
    std::array<std::uint8_t, 20> head_{};
    std::array<std::uint8_t, 80> line_{};
    std::array<std::uint8_t, 96> sealed_{};
    std::uint64_t counter_ = 0;
};

/// To sign the bytes of an update, and to verify that.
class signing {
  public:
    void sign() { made_ = key_.sign(text_); }
    void verify() {
        if (!cles::security::verify(key_.public_part(), text_, made_)) {
            throw std::runtime_error("a signature does not hold");
        }
    }

  private:
    cles::security::signing_key key_ = cles::security::signing_key::generate();
    std::string text_ = std::string(190, 'x');
    cles::security::signature made_{};
};

bool report(const char* what, double plain, double secured, double most) {
    const bool good = secured <= most;
    std::printf("%s: plain %.1f us, secured %.1f us; permitted %.1f us%s\n", what, plain, secured, most,
                good ? "" : ": TOO MUCH");
    return good;
}

bool measure(double slack) {
    const fleet_folder keys;
    two_nodes plain{nullptr, {}};
    two_nodes sealed{&keys, {}};
    two_nodes with_signatures{&keys, {.must_be_signed = true}};
    sealing one_seal;
    signing one_signature;
    recording plain_pull;
    recording sealed_pull;
    recording plain_update;
    recording sealed_update;
    recording signed_update;
    recording seals;
    recording signatures;
    for (std::size_t i = 0; i < warm_up + counted; ++i) {
        plain_pull.time([&] { plain.pull(); });
        sealed_pull.time([&] { sealed.pull(); });
        plain_update.time([&] { plain.update(); });
        sealed_update.time([&] { sealed.update(); });
        signed_update.time([&] { with_signatures.update(); });
        seals.time([&] {
            for (int each = 0; each < 10; ++each) {
                one_seal.seal();
                one_seal.open();
            }
        });
        signatures.time([&] {
            one_signature.sign();
            one_signature.verify();
        });
    }
    const auto seal = seals.median() / 20;
    const auto signature = signatures.median();
    std::printf("to seal or to open a line: %.2f us; to sign and to verify: %.1f us\n", seal, signature);
    const auto pull = plain_pull.median();
    const auto update = plain_update.median();
    std::printf("UPDATE by multicast, sealed: %.1f us\n", sealed_update.median());
    const bool pull_good = report("PULL by datagrams", pull, sealed_pull.median(), pull + 4 * seal + 1.5 * slack);
    return report("UPDATE by multicast, signed", update, signed_update.median(),
                  update + signature + 0.4 * signature * slack) &&
           pull_good;
}

} // namespace

int main(int count, char** arguments) {
    try {
        return measure(count > 1 ? std::strtod(arguments[1], nullptr) : 1) ? 0 : 1;
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "%s\n", failure.what());
        return 1;
    }
}
