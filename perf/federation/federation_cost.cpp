// SPDX-License-Identifier: BSL-1.0
// PULL through two bridges of different pools, without security and sealed, against request and reply of two bare
// programs of libnats, through the same server: latency with one request in flight, and requests a second with 64.
// Prints JSON.
//
//     cles_federation_cost URL FLEET [requests of a round]
//
// FLEET contains the keys of `gate` and `hub`; perf/federation/measure.py makes them, and starts a server.
#include <cles/federation.hpp>
#include <cles/json_reader.hpp>
#include <cles/security.hpp>
#include <cles/service.hpp>

#include "perf/support/child_process.hpp"
#include "perf/support/clock.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/localization.hpp"
#include "perf/support/pinning.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include <nats/nats.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

using cles::perf::localization;

constexpr std::size_t rounds = 5;
constexpr std::size_t in_flight = 64;
constexpr const char* bare_subject = "bare.gate.localization";

std::string text_of(const localization& value) {
    std::string text;
    cles::json_writer w{text};
    write_json(w, value);
    return text;
}

void check(natsStatus code) {
    if (code != NATS_OK) {
        throw std::runtime_error{natsStatus_GetText(code)};
    }
}

// -- two bare programs ---------------------------------------------------------------------------------------------

natsConnection* connect(const char* url) {
    natsOptions* options = nullptr;
    natsConnection* made = nullptr;
    check(natsOptions_Create(&options));
    check(natsOptions_SetURL(options, url));
    check(natsOptions_SetSendAsap(options, true)); // the fastest that the library offers for a single request
    check(natsConnection_Connect(&made, options));
    natsOptions_Destroy(options);
    return made;
}

void serve_bare(const std::string& url, const cles::perf::child_process::announce& ready) {
    auto* const connection = connect(url.c_str());
    natsSubscription* subscription = nullptr;
    static std::atomic<std::uint64_t> count{0};
    check(natsConnection_Subscribe(
        &subscription, connection, bare_subject,
        [](natsConnection* c, natsSubscription*, natsMsg* asked, void*) {
            const auto text = text_of(cles::perf::sample(++count));
            natsConnection_Publish(c, natsMsg_GetReply(asked), text.data(), static_cast<int>(text.size()));
            natsMsg_Destroy(asked);
        },
        nullptr));
    check(natsConnection_Flush(connection));
    ready("bare");
    for (;;) {
        nats_Sleep(1'000);
    }
}

class bare_requester {
  public:
    explicit bare_requester(const std::string& url) : connection_(connect(url.c_str())) {}

    void ask_one_by_one(cles::perf::latency_recorder& into) {
        while (!into.full()) {
            const auto begun = std::chrono::steady_clock::now();
            natsMsg* reply = nullptr;
            check(natsConnection_Request(&reply, connection_, bare_subject, nullptr, 0, 5'000));
            into.record(std::chrono::steady_clock::now() - begun);
            natsMsg_Destroy(reply);
        }
    }
    double requests_per_second(std::size_t requests) {
        std::string inbox = "_INBOX.bare";
        natsSubscription* subscription = nullptr;
        left_ = requests;
        unanswered_ = requests;
        check(natsConnection_Subscribe(&subscription, connection_, inbox.c_str(), &bare_requester::on_reply, this));
        check(natsConnection_Flush(connection_));
        const auto begun = std::chrono::steady_clock::now();
        for (std::size_t i = 0; i < in_flight; ++i) {
            send_next();
        }
        std::unique_lock lock{mutex_};
        done_.wait(lock, [this] { return unanswered_ == 0; });
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
        natsSubscription_Destroy(subscription);
        return static_cast<double>(requests) / took.count();
    }

  private:
    static void on_reply(natsConnection*, natsSubscription*, natsMsg* reply, void* self) {
        natsMsg_Destroy(reply);
        auto& me = *static_cast<bare_requester*>(self);
        me.send_next();
        const std::lock_guard lock{me.mutex_};
        if (--me.unanswered_ == 0) {
            me.done_.notify_one();
        }
    }
    void send_next() {
        {
            const std::lock_guard lock{mutex_};
            if (left_ == 0) {
                return;
            }
            --left_;
        }
        natsConnection_PublishRequest(connection_, bare_subject, "_INBOX.bare", nullptr, 0);
    }

    natsConnection* connection_;
    std::mutex mutex_;
    std::condition_variable done_;
    std::size_t left_ = 0;
    std::size_t unanswered_ = 0;
};

// -- two bridges ---------------------------------------------------------------------------------------------------

struct pools {
    std::string url;
    std::string keys;  // empty: without security
    std::string north; // where the task is
    std::string south;
};

cles::service_options bridge_options(const pools& of, const std::string& name, const std::string& pool) {
    cles::service_options options{.name = name};
    options.routing = cles::routing();
    options.insecure = of.keys.empty();
    if (!of.keys.empty()) {
        options.security = cles::secured(of.keys + '/' + name);
    }
    options.federation = cles::federation({.servers = {of.url}, .pool = pool});
    return options;
}

void serve_federated(const pools& of, const cles::perf::child_process::announce& ready) {
    boost::asio::io_context io{1};
    cles::service gate{io, bridge_options(of, "gate", of.north)};
    std::uint64_t count = 0;
    gate.on_pull("localization", [&count] { return cles::perf::sample(++count); });
    ready("federated");
    io.run();
}

class federated_requester {
  public:
    explicit federated_requester(const pools& of)
        : noun_(of.north + ".gate:localization"), hub_(io_, bridge_options(of, "hub", of.south)) {
        reach();
    }

    /// The bridge was silent while others were measured, so the other end may have to find it again.
    void reach() {
        const auto until = std::chrono::steady_clock::now() + std::chrono::seconds{5};
        boost::system::error_code code;
        do {
            hub_.async_pull<localization>(noun_, [&](boost::system::error_code result, const localization&) {
                code = result;
                io_.stop();
            });
            io_.run();
            io_.restart();
            if (code) {
                io_.run_for(std::chrono::milliseconds{20});
                io_.restart();
            }
        } while (code && std::chrono::steady_clock::now() < until);
        if (code) {
            throw std::runtime_error{"the other pool is not found: " + code.message()};
        }
    }

    void ask_one_by_one(cles::perf::latency_recorder& into) {
        recorder_ = &into;
        left_ = into.remaining();
        run(1);
    }
    double requests_per_second(std::size_t requests) {
        recorder_ = nullptr;
        left_ = requests;
        const auto begun = std::chrono::steady_clock::now();
        run(in_flight);
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
        return static_cast<double>(requests) / took.count();
    }

  private:
    void run(std::size_t at_once) {
        for (std::size_t i = 0; i < at_once; ++i) {
            ask();
        }
        io_.run();
        io_.restart();
    }
    void ask() {
        if (left_ == 0) {
            if (open_ == 0) {
                io_.stop();
            }
            return;
        }
        --left_;
        ++open_;
        const auto begun = std::chrono::steady_clock::now();
        hub_.async_pull<localization>(noun_, [this, begun](boost::system::error_code code, const localization& value) {
            if (code || !is_sample(value)) {
                throw std::runtime_error{"a request failed: " + code.message()};
            }
            if (recorder_ != nullptr) {
                recorder_->record(std::chrono::steady_clock::now() - begun);
            }
            --open_;
            ask();
        });
    }

    std::string noun_;
    boost::asio::io_context io_{1};
    cles::service hub_;
    cles::perf::latency_recorder* recorder_ = nullptr;
    std::size_t left_ = 0;
    std::size_t open_ = 0;
};

// -- the comparison ------------------------------------------------------------------------------------------------

struct figures {
    std::vector<double> p50s; // of each round, in microseconds
    std::vector<double> rates;
};

double median(std::vector<double> of) {
    std::sort(of.begin(), of.end());
    return of[of.size() / 2];
}

template <class Requester>
void measure(Requester& ask, cles::perf::latency_recorder& recorder, std::size_t requests, figures& into) {
    recorder.clear();
    ask.ask_one_by_one(recorder);
    into.p50s.push_back(recorder.quantiles().p50);
    into.rates.push_back(ask.requests_per_second(requests * 5));
}

void compare(const std::string& url, const std::string& fleet, std::size_t requests) {
    const pools plain{.url = url, .keys = {}, .north = "north", .south = "south"};
    const pools sealed{.url = url, .keys = fleet, .north = "sealed_north", .south = "sealed_south"};
    const auto core = cles::perf::place_ends().server;
    cles::perf::child_process bare{core, [&](const auto& ready) { serve_bare(url, ready); }};
    cles::perf::child_process plain_gate{core, [&](const auto& ready) { serve_federated(plain, ready); }};
    cles::perf::child_process sealed_gate{core, [&](const auto& ready) { serve_federated(sealed, ready); }};
    bare.announced();
    plain_gate.announced();
    sealed_gate.announced();
    bare_requester bare_ask{url};
    federated_requester plain_ask{plain};
    federated_requester sealed_ask{sealed};

    cles::perf::latency_recorder recorder{requests};
    figures of_bare;
    figures of_plain;
    figures of_sealed;
    for (std::size_t round = 0; round < rounds; ++round) {
        measure(bare_ask, recorder, requests, of_bare);
        plain_ask.reach();
        measure(plain_ask, recorder, requests, of_plain);
        sealed_ask.reach();
        measure(sealed_ask, recorder, requests, of_sealed);
    }
    const auto print = [](const char* key, const figures& of, char end) {
        std::printf(R"("%s":{"p50_us":%.1f,"per_s":%.0f}%c)", key, median(of.p50s), median(of.rates), end);
    };
    std::putchar('{');
    print("bare", of_bare, ',');
    print("plain", of_plain, ',');
    print("sealed", of_sealed, '}');
    std::putchar('\n');
}

} // namespace

int main(int argc, char** argv) {
    try {
        if (argc < 3) {
            std::fputs("usage: cles_federation_cost URL FLEET [requests of a round]\n", stderr);
            return 2;
        }
        constexpr std::size_t usual = 4'000;
        compare(argv[1], argv[2], argc > 3 ? std::strtoul(argv[3], nullptr, 10) : usual);
        std::fflush(stdout);
        std::_Exit(0); // the threads of the library
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "cles_federation_cost: %s\n", failure.what());
        std::_Exit(1);
    }
}
