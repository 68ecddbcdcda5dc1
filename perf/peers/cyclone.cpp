// SPDX-License-Identifier: BSL-1.0
// Cyclone DDS: listeners on both sides, which run on the thread that receives, so that nothing is handed on to another;
// reliable, keeping as many samples as are in flight; on the loopback interface alone. A request and its reply are
// topics with a number in both.
#include "driver/ordered_fan_out.hpp"
#include "driver/peer.hpp"
#include "localization.h"

#include <dds/dds.h>
#include <dds/version.h>

#include <array>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <vector>

#include <unistd.h>

namespace cles::perf::peers {
namespace {

constexpr std::int32_t depth = 1024; // samples that are kept: more than are ever in flight
constexpr std::size_t taken_at_once = 64;
constexpr std::chrono::milliseconds between_attempts{10};
constexpr int most_attempts = 1000;

// A domain of its own, and a tag that separates its discovery from others.
const char* const settings = R"(<CycloneDDS><Domain id="any">
  <General>
    <Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces>
    <AllowMulticast>true</AllowMulticast>
  </General>
  <Discovery><Tag>cles-peers-)";
const char* const settings_end = "</Tag></Discovery></Domain></CycloneDDS>";

dds_entity_t require(dds_return_t code, const char* attempted) {
    if (code < 0) {
        throw std::runtime_error(std::string{"Cyclone DDS, "} + attempted + ": " + ::dds_strretcode(-code));
    }
    return code;
}

class participant {
  public:
    explicit participant(const std::string& tag) {
        const auto id = static_cast<dds_domainid_t>(std::stoul(tag) % 200);
        domain_ = require(::dds_create_domain(id, (settings + tag + settings_end).c_str()), "the domain");
        self_ = require(::dds_create_participant(id, nullptr, nullptr), "a participant");
        qos_ = ::dds_create_qos();
        ::dds_qset_reliability(qos_, DDS_RELIABILITY_RELIABLE, DDS_SECS(10));
        ::dds_qset_history(qos_, DDS_HISTORY_KEEP_LAST, depth);
    }
    participant(const participant&) = delete;
    participant& operator=(const participant&) = delete;
    ~participant() {
        ::dds_delete(domain_); // with all that is in it
        ::dds_delete_qos(qos_);
    }

    dds_entity_t writer(const dds_topic_descriptor_t& type, const char* name) {
        return require(::dds_create_writer(self_, topic(type, name), qos_, nullptr), "a writer");
    }

    dds_entity_t reader(const dds_topic_descriptor_t& type, const char* name, dds_on_data_available_fn taking,
                        void* of) {
        auto* const listener = ::dds_create_listener(of);
        ::dds_lset_data_available(listener, taking);
        const auto made = ::dds_create_reader(self_, topic(type, name), qos_, listener);
        ::dds_delete_listener(listener);
        return require(made, "a reader");
    }

  private:
    dds_entity_t topic(const dds_topic_descriptor_t& type, const char* name) {
        return require(::dds_create_topic(self_, &type, name, nullptr, nullptr), "a topic");
    }

    dds_entity_t domain_ = 0;
    dds_entity_t self_ = 0;
    dds_qos_t* qos_ = nullptr;
};

/// Passes on each sample that has arrived, without a copy.
template <class Sample, class Take>
void take_all(dds_entity_t reader, Take&& take) {
    std::array<void*, taken_at_once> loans{};
    std::array<dds_sample_info_t, taken_at_once> infos{};
    for (;;) {
        const auto got = ::dds_take(reader, loans.data(), infos.data(), loans.size(), loans.size());
        if (got <= 0) {
            return;
        }
        for (std::size_t i = 0; i < static_cast<std::size_t>(got); ++i) {
            if (infos[i].valid_data) {
                take(*static_cast<const Sample*>(loans[i]));
            }
        }
        ::dds_return_loan(reader, loans.data(), got);
    }
}

struct serving {
    dds_entity_t replies = 0;
    std::uint64_t served = 0;
};

void answer_exchange(dds_entity_t reader, void* of) {
    auto& node = *static_cast<serving*>(of);
    take_all<cles_peers_request>(reader, [&](const cles_peers_request& request) {
        const auto& value = sample(node.served++);
        const cles_peers_localization reply{request.id, value.utc,      value.lat,
                                            value.lon,  value.velocity, value.acceleration};
        ::dds_write(node.replies, &reply);
    });
}

void answer_task(dds_entity_t reader, void* of) {
    const auto& node = *static_cast<serving*>(of);
    take_all<cles_peers_request>(reader, [&](const cles_peers_request& request) {
        const cles_peers_done reply{request.id};
        ::dds_write(node.replies, &reply);
    });
}

/// Sends the next request in the listener, as soon as an answer has arrived.
class cyclone_caller final : public caller {
  public:
    cyclone_caller(call what, const std::string& where) : bus_(where) {
        requests_ = bus_.writer(cles_peers_request_desc, "request");
        if (what == call::exchange) {
            bus_.reader(cles_peers_localization_desc, "reply", &take_localization, this);
        } else {
            bus_.reader(cles_peers_done_desc, "reply", &take_done, this);
        }
        // Discovery takes time on each side: repeats the request until there is an answer.
        for (int attempt = 0; attempt < most_attempts; ++attempt) {
            std::unique_lock lock{guard_};
            write(0);
            if (news_.wait_for(lock, between_attempts, [this] { return is_reached_; })) {
                return;
            }
        }
        throw std::runtime_error("Cyclone DDS: the two ends do not find each other");
    }

    void ask(std::size_t in_flight, latency_recorder& record) override {
        std::unique_lock lock{guard_};
        record_ = &record;
        began_.assign(in_flight, {});
        to_ask_ = record.remaining();
        first_id_ = next_id_;
        for (std::size_t i = 0; i < in_flight && to_ask_ > 0; ++i) {
            next();
        }
        news_.wait(lock, [this] { return record_->full() || is_wrong_; });
        record_ = nullptr;
        if (is_wrong_) {
            throw std::runtime_error("the received values are not those that were sent");
        }
    }

  private:
    using clock = std::chrono::steady_clock;

    static void take_localization(dds_entity_t reader, void* of) {
        take_all<cles_peers_localization>(reader, [&](const cles_peers_localization& reply) {
            static_cast<cyclone_caller*>(of)->take(
                reply.id, is_sample({reply.utc, reply.lat, reply.lon, reply.velocity, reply.acceleration}));
        });
    }
    static void take_done(dds_entity_t reader, void* of) {
        take_all<cles_peers_done>(
            reader, [&](const cles_peers_done& reply) { static_cast<cyclone_caller*>(of)->take(reply.id, true); });
    }

    void take(std::uint64_t id, bool is_right) {
        const auto now = clock::now();
        const std::lock_guard lock{guard_};
        is_reached_ = true;
        is_wrong_ = is_wrong_ || !is_right;
        if (record_ != nullptr && id >= first_id_) {
            record_->record(now - began_[id % began_.size()]);
            if (to_ask_ > 0) {
                next();
            }
        }
        if (record_ == nullptr || record_->full() || is_wrong_) {
            news_.notify_one();
        }
    }

    void next() {
        --to_ask_;
        const auto id = next_id_++;
        began_[id % began_.size()] = clock::now();
        write(id);
    }

    void write(std::uint64_t id) const {
        const cles_peers_request request{id};
        require(::dds_write(requests_, &request), "a request");
    }

    std::mutex guard_;
    std::condition_variable news_;
    bool is_reached_ = false;
    bool is_wrong_ = false;
    latency_recorder* record_ = nullptr;
    std::vector<clock::time_point> began_;
    std::size_t to_ask_ = 0;
    std::uint64_t next_id_ = 1;
    std::uint64_t first_id_ = 1;
    dds_entity_t requests_ = 0;
    participant bus_;
};

/// A reader for each subscriber. They share the sockets of their process, as all readers of a domain do.
class cyclone_subscriptions final : public subscriptions {
  public:
    cyclone_subscriptions(const std::string& where, std::size_t count, inbox& into) : places_(count), bus_(where) {
        for (std::size_t i = 0; i < count; ++i) {
            places_[i] = {.number = i, .into = &into};
            bus_.reader(cles_peers_publication_desc, "publication", &take, &places_[i]);
        }
    }

  private:
    struct place {
        std::size_t number = 0;
        inbox* into = nullptr;
    };

    static void take(dds_entity_t reader, void* of) {
        const auto& place_of = *static_cast<place*>(of);
        take_all<cles_peers_publication>(reader, [&](const cles_peers_publication& came) {
            publication value;
            static_cast<localization&>(value) = {came.utc, came.lat, came.lon, came.velocity, came.acceleration};
            value.published_ns = came.published_ns;
            place_of.into->take(place_of.number, value);
        });
    }

    std::vector<place> places_;
    participant bus_;
};

class cyclone final : public peer {
  public:
    cyclone() : where_(std::to_string(::getpid())) {}

    void serve(call what, const announce& tell) override {
        const bool is_exchange = what == call::exchange;
        serving node;
        participant bus{where_};
        node.replies = bus.writer(is_exchange ? cles_peers_localization_desc : cles_peers_done_desc, "reply");
        bus.reader(cles_peers_request_desc, "request", is_exchange ? &answer_exchange : &answer_task, &node);
        tell(where_);
        for (;;) {
            ::pause();
        }
    }

    std::unique_ptr<caller> call_at(call what, const std::string& where) override {
        return std::make_unique<cyclone_caller>(what, where);
    }

    void publish(const announce& tell) override {
        participant bus{where_};
        const auto writer = bus.writer(cles_peers_publication_desc, "publication");
        publish_by_order(where_, tell, [&](const publication& value) {
            const cles_peers_publication out{value.published_ns, value.utc,      value.lat,
                                             value.lon,          value.velocity, value.acceleration};
            require(::dds_write(writer, &out), "publishing");
        });
    }

    std::unique_ptr<fan_out> subscribe(const std::string& where, std::size_t count) override {
        return std::make_unique<ordered_fan_out>(where, count, [count](const std::string& at, inbox& into) {
            return std::make_unique<cyclone_subscriptions>(at, count, into);
        });
    }

  private:
    std::string where_;
};

} // namespace

const description about{
    .name = "cyclone",
    .carriers = "udp",
    .settings =
        "listeners on both sides, reliable, keep last 1024, the loopback interface alone, by multicast where possible",
};

std::string version() { return DDS_VERSION; }

std::unique_ptr<peer> make_peer(std::string_view) { return std::make_unique<cyclone>(); }

} // namespace cles::perf::peers
