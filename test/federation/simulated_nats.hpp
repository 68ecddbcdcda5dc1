// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "federation/bridge.hpp"
#include "federation/sealed_channel.hpp"
#include "port/message_seal.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::bridging::test {

class site;

/// A NATS server in virtual time, with faults.
class simulated_nats {
  public:
    struct faults {
        std::chrono::microseconds shortest_delay{0}; ///< of a message
        std::chrono::microseconds longest_delay{0};  ///< of a message; more than one may overtake each other
        double loss = 0;
        double repetition = 0;
    };

    explicit simulated_nats(std::uint32_t seed) : random_(seed) {}

    [[nodiscard]] time_point now() const noexcept { return now_; }
    faults& impair() noexcept { return faults_; }
    std::mt19937& random() noexcept { return random_; }
    [[nodiscard]] bool happens(double probability) { return std::bernoulli_distribution{probability}(random_); }

    void at(time_point when, std::function<void()> then);
    void run_for(std::chrono::milliseconds time);

    void publish(const std::string& subject, const std::string& reply, const std::string& message);
    void add(site& s) { sites_.insert(&s); }
    void remove(site& s) { sites_.erase(&s); }
    /// Publications so far, by the third token of the subject: "pull", "feed", "beat".
    [[nodiscard]] std::uint64_t published(const std::string& kind) const;
    /// What was published on a subject that begins with this, as "subject message".
    [[nodiscard]] std::vector<std::string> recorded(std::string_view prefix) const;
    /// Messages for which it returns true are lost.
    std::function<bool(const std::string& subject, const std::string& message)> lose;

  private:
    void send(site& to, std::uint64_t connection, const std::string& subject, const std::string& reply,
              const std::string& message);

    struct entry {
        time_point when;
        std::uint64_t order;
        bool operator<(const entry& other) const { return std::pair{when, order} < std::pair{other.when, other.order}; }
    };

    time_point now_{std::chrono::hours{1}};
    std::mt19937 random_;
    faults faults_;
    std::map<entry, std::function<void()>> agenda_;
    std::uint64_t order_ = 0;
    std::set<site*> sites_;
    std::map<std::string, std::uint64_t> counts_;
    std::vector<std::string> record_;
};

/// What makes a site one of a secured fleet.
struct site_security {
    std::function<std::unique_ptr<core::message_seal>()> make_seal; ///< for a connection
    std::function<std::uint32_t()> roster_version;
};

/// A bridge and its node. The node answers requests for `echo` with their body, at once or after `answer_after`, and
/// keeps what it has executed.
class site final : public bridge_output, private bridge_trust {
  public:
    site(simulated_nats& by, std::string pool, std::string node, std::optional<site_security> security = {});
    ~site();

    void connect();
    void disconnect();
    /// Restarts: a new bridge, which has forgotten everything, and is not connected.
    void restart();
    /// The node asks on its link to that pool. Returns the id.
    std::uint64_t ask(const std::string& pool, const std::string& request, std::uint32_t link = 1);
    void cancel(const std::string& pool, std::uint64_t id, std::uint32_t link = 1);
    /// The node publishes an update of a noun that the bridge has bound there, on each link on which it has. \param on
    /// only on this one
    void update(const std::string& noun, std::uint64_t seq, const std::optional<bridge_link>& on = {},
                const std::string& epoch = "5f3a09c1");
    /// The node closes that link of the bridge.
    void close(const bridge_link& which);
    void receive(const std::string& subject, const std::string& reply, const std::string& message);
    [[nodiscard]] bool subscribes(std::string_view subject, bool shared) const;
    [[nodiscard]] std::uint64_t connection() const noexcept { return connection_; }
    [[nodiscard]] bridge& core() noexcept { return *bridge_; }
    /// A message as this site seals it. \pre it is of a secured fleet, and connected
    [[nodiscard]] std::string seal(std::string_view subject, std::string_view reply, std::string_view message) {
        return channel_->seal(subject, reply, message, nats_.now()).bytes;
    }
    /// The rights have changed.
    void change_security();
    /// The last line that answers the request.
    [[nodiscard]] std::string answer(std::uint64_t id) const;

    /// The node, if it is another one: receives the lines, and passes its own to `core`.
    std::function<void(const bridge_link& on, const std::string& line)> serves;
    std::vector<std::string> names; ///< of its pool's nodes
    std::chrono::milliseconds answer_after{0};
    std::map<std::string, int> executed;                       ///< how often, by the body of the request
    std::vector<std::string> cancelled;                        ///< bodies of requests that the node has cancelled
    std::map<std::uint64_t, std::vector<std::string>> answers; ///< to its own requests
    std::vector<std::string> updates;                          ///< lines
    std::set<std::string> bound;                               ///< nouns that the bridge has bound at the node
    std::map<std::string, std::set<bridge_link>> bound_on;     ///< the same, and on which links
    std::vector<bridge_link> ended;                            ///< links that the bridge has ended
    std::vector<std::string> lost; ///< what was lost: "pool north", "binding car9:speed", "all"
    std::vector<std::string> logged;
    int pools_changed = 0;
    bool is_full = false; ///< only short messages can be published

    // In a secured fleet.
    std::set<std::string> distrusted;       ///< members that may not forward for this node
    std::set<std::string> denied;           ///< members for which no node here lets anything be bound
    mutable std::vector<std::string> binds; ///< whose rights were checked: "gate hub car9:speed" of gate, from=hub
    std::vector<std::string> rosters;       ///< versions that were stated: "<instance> 2"
    bool has_sessions = true;               ///< false: as bridges of earlier versions
    bool states_sessions_only = false;      ///< it does not note which others have them

  private:
    bool publish(std::string subject, std::string reply, std::string message, room in) override;
    void subscribe(std::string subject, bool shared) override;
    void unsubscribe(const std::string& subject) override;
    void deliver(const bridge_link& on, std::string line) override;
    void end(const bridge_link& which) override { ended.push_back(which); }
    void lose_pool(std::string_view pool, std::string_view why) override;
    void lose_all(std::string_view why) override;
    void lose_binding(const bridge_link& on, const std::string& noun, std::string_view why) override;
    void on_pools_changed() override { ++pools_changed; }
    [[nodiscard]] std::vector<std::string> home_names() const override { return names; }
    void log(log_level level, const std::string& text) override;

    [[nodiscard]] bool may_forward(std::string_view member) const override;
    [[nodiscard]] std::string how_to_permit(std::string_view member) const override;
    [[nodiscard]] std::optional<protocol::failure> refusal(std::string_view member,
                                                           const protocol::request_line& bind) const override;
    [[nodiscard]] std::uint32_t roster_version() const override { return security_->roster_version(); }
    void on_lost(const bridge_id& gone) override { channel_->forget(gone); }
    void on_stated_roster(const bridge_id& by, std::uint32_t version) override;
    void on_stated_sessions(const bridge_id& by) override;

    void serve(const bridge_link& on, const std::string& line);
    void reply(const bridge_link& on, std::uint64_t id, const std::string& rest);
    void unbind(const std::string& noun, const bridge_link& on);
    void publish_questions();
    void tick();

    simulated_nats& nats_;
    std::string pool_;
    std::string node_;
    std::optional<site_security> security_;
    std::optional<sealed_channel> channel_; // in a secured fleet, while it is connected
    std::unique_ptr<bridge> bridge_;
    std::multimap<std::string, bool> subscriptions_; // whether they are shared
    std::uint64_t connection_ = 0;                   // 0: none
    std::uint64_t last_connection_ = 0;
    std::uint64_t life_ = 0; // of the node's links
    std::uint64_t last_id_ = 0;
    std::map<std::pair<bridge_link, std::uint64_t>, std::string> running_; // bodies
    std::vector<std::pair<bridge_link, std::string>> delivered_;           // in this call
    time_point tick_at_{};                                                 // the next; before now: none
};

} // namespace cles::bridging::test
