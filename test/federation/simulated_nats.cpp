// SPDX-License-Identifier: BSL-1.0
#include "simulated_nats.hpp"

#include "protocol/request_line.hpp"

#include <algorithm>

namespace cles::bridging::test {
namespace {

using std::chrono::milliseconds;

std::vector<std::string_view> tokens_of(std::string_view text) {
    std::vector<std::string_view> tokens;
    for (;;) {
        const auto dot = text.find('.');
        tokens.push_back(text.substr(0, dot));
        if (dot == std::string_view::npos) {
            return tokens;
        }
        text.remove_prefix(dot + 1);
    }
}

bool matches(std::string_view filter, std::string_view subject) {
    const auto wanted = tokens_of(filter);
    const auto given = tokens_of(subject);
    return wanted.size() == given.size() &&
           std::equal(wanted.begin(), wanted.end(), given.begin(),
                      [](std::string_view f, std::string_view s) { return f == "*" || f == s; });
}

} // namespace

// -- the server ----------------------------------------------------------------------------------------------------

void simulated_nats::at(time_point when, std::function<void()> then) {
    agenda_.emplace(entry{std::max(when, now_), ++order_}, std::move(then));
}

void simulated_nats::run_for(milliseconds time) {
    const auto until = now_ + time;
    while (!agenda_.empty() && agenda_.begin()->first.when <= until) {
        auto next = agenda_.extract(agenda_.begin());
        now_ = next.key().when;
        next.mapped()();
    }
    now_ = until;
}

std::uint64_t simulated_nats::published(const std::string& kind) const {
    const auto found = counts_.find(kind);
    return found == counts_.end() ? 0 : found->second;
}

std::vector<std::string> simulated_nats::recorded(std::string_view prefix) const {
    std::vector<std::string> found;
    std::copy_if(record_.begin(), record_.end(), std::back_inserter(found),
                 [prefix](const std::string& each) { return each.starts_with(prefix); });
    return found;
}

void simulated_nats::send(site& to, std::uint64_t connection, const std::string& subject, const std::string& reply,
                          const std::string& message) {
    if ((lose && lose(subject, message)) || happens(faults_.loss)) {
        return;
    }
    const int copies = happens(faults_.repetition) ? 2 : 1;
    for (int i = 0; i < copies; ++i) {
        const auto delay = std::uniform_int_distribution<std::int64_t>{faults_.shortest_delay.count(),
                                                                       faults_.longest_delay.count()}(random_);
        at(now_ + std::chrono::microseconds{delay}, [this, &to, connection, subject, reply, message] {
            if (sites_.contains(&to) && to.connection() == connection) {
                to.receive(subject, reply, message);
            }
        });
    }
}

void simulated_nats::publish(const std::string& subject, const std::string& reply, const std::string& message) {
    const auto tokens = tokens_of(subject);
    ++counts_[tokens.size() > 2 ? std::string{tokens[2]} : subject];
    record_.push_back(subject + " " + message);
    std::vector<site*> group;
    for (auto* const each : sites_) {
        if (each->connection() != 0 && each->subscribes(subject, false)) {
            send(*each, each->connection(), subject, reply, message);
        }
        if (each->connection() != 0 && each->subscribes(subject, true)) {
            group.push_back(each);
        }
    }
    if (!group.empty()) {
        auto* const chosen = group[std::uniform_int_distribution<std::size_t>{0, group.size() - 1}(random_)];
        send(*chosen, chosen->connection(), subject, reply, message);
    }
}

// -- a site --------------------------------------------------------------------------------------------------------

site::site(simulated_nats& by, std::string pool, std::string node, std::optional<site_security> security)
    : names{node}, nats_(by), pool_(std::move(pool)), node_(std::move(node)), security_(std::move(security)) {
    nats_.add(*this);
    restart();
}

site::~site() { nats_.remove(*this); }

void site::restart() {
    connection_ = 0;
    ++life_;
    subscriptions_.clear();
    running_.clear();
    bound.clear();
    bound_on.clear();
    channel_.reset();
    bridge_ = std::make_unique<bridge>(bridge::settings{.pool = pool_, .node = node_}, *this,
                                       security_ ? static_cast<bridge_trust*>(this) : nullptr);
}

void site::connect() {
    subscriptions_.clear();
    connection_ = ++last_connection_;
    constexpr std::size_t most = 1U << 16U;
    if (security_) {
        channel_.emplace(security_->make_seal(), pool_);
        bridge_->on_connected(channel_->instance(), most - core::message_seal::overhead, nats_.now());
    } else {
        bridge_->on_connected((std::uint64_t{nats_.random()()} << 32U) | nats_.random()(), most, nats_.now());
    }
    tick();
}

void site::disconnect() {
    connection_ = 0;
    bridge_->on_disconnected("the server has ended", nats_.now());
}

void site::tick() {
    const auto due = bridge_->due();
    if (connection_ == 0 || (tick_at_ > nats_.now() && tick_at_ <= due)) {
        return;
    }
    tick_at_ = due;
    nats_.at(due, [this, due, &by = nats_] {
        if (tick_at_ == due) {
            tick_at_ = {};
        }
        if (connection_ != 0 && bridge_->due() <= by.now()) {
            bridge_->on_time(by.now());
            bridge_->on_batch();
        }
        tick();
    });
}

std::uint64_t site::ask(const std::string& pool, const std::string& request, std::uint32_t link) {
    const auto id = ++last_id_;
    const auto body = request.find('{');
    auto line = request.substr(0, body);
    line.append(line.ends_with(' ') ? "id=" : " id=").append(std::to_string(id));
    if (body != std::string::npos) {
        line.append(" ").append(request.substr(body));
    }
    bridge_->on_line({bridge_link::role::to_pool, pool, link}, line, nats_.now());
    return id;
}

void site::cancel(const std::string& pool, std::uint64_t id, std::uint32_t link) {
    bridge_->on_line({bridge_link::role::to_pool, pool, link},
                     "PUSH self:cles/cancel/" + std::to_string(id) + " reply=no", nats_.now());
}

void site::update(const std::string& noun, std::uint64_t seq, const std::optional<bridge_link>& on,
                  const std::string& epoch) {
    const auto found = bound_on.find(noun);
    if (found == bound_on.end()) {
        return;
    }
    for (const auto& link : std::set{found->second}) {
        if (!on || link == *on) {
            bridge_->on_line(link,
                             "UPDATE " + noun + " seq=" + std::to_string(seq) + " epoch=" + epoch +
                                 " {\"n\":" + std::to_string(seq) + "}",
                             nats_.now());
        }
    }
}

void site::close(const bridge_link& which) {
    for (const auto& noun : std::set{bound}) {
        unbind(noun, which);
    }
    bridge_->on_closed(which);
}

void site::unbind(const std::string& noun, const bridge_link& on) {
    if (const auto found = bound_on.find(noun); found != bound_on.end()) {
        found->second.erase(on);
        if (found->second.empty()) {
            bound_on.erase(found);
            bound.erase(noun);
        }
    }
}

void site::receive(const std::string& subject, const std::string& reply, const std::string& message) {
    const received_message received{subject, reply, message, nats_.now()};
    if (channel_) {
        channel_->receive(received, *bridge_);
        for (const auto& each : channel_->take_ready(nats_.now())) {
            nats_.publish(each.subject, each.reply, each.message);
        }
        publish_questions();
    } else {
        bridge_->on_message(received);
    }
    for (const auto& [on, line] : std::exchange(delivered_, {})) {
        serve(on, line);
    }
    bridge_->on_batch();
    tick();
}

void site::change_security() {
    bridge_->on_security_changed(nats_.now());
    tick();
}

std::string site::answer(std::uint64_t id) const {
    const auto found = answers.find(id);
    return found == answers.end() || found->second.empty() ? std::string{} : found->second.back();
}

bool site::subscribes(std::string_view subject, bool shared) const {
    return std::any_of(subscriptions_.begin(), subscriptions_.end(),
                       [&](const auto& each) { return each.second == shared && matches(each.first, subject); });
}

bool site::publish(std::string subject, std::string reply, std::string message, room in) {
    if (is_full && in == room::shared) {
        return false;
    }
    if (connection_ == 0) {
        return true;
    }
    if (channel_) {
        constexpr std::string_view stated = R"(,"sessions":true)";
        if (const auto at = message.find(stated); !has_sessions && at != std::string::npos) {
            message.erase(at, stated.size());
        }
        auto sealed = channel_->seal(subject, reply, message, nats_.now());
        if (sealed.waits) {
            publish_questions();
            return true;
        }
        if (sealed.bytes.empty()) { // it is no member
            return false;
        }
        message = std::move(sealed.bytes);
    }
    nats_.publish(subject, reply, message);
    return true;
}

void site::subscribe(std::string subject, bool shared) { subscriptions_.emplace(std::move(subject), shared); }
void site::unsubscribe(const std::string& subject) { subscriptions_.erase(subject); }

void site::deliver(const bridge_link& on, std::string line) {
    if (on.what == bridge_link::role::to_pool) {
        if (line.starts_with("UPDATE ")) {
            updates.push_back(std::move(line));
            return;
        }
        const auto space = line.find(' ');
        answers[std::stoull(line.substr(3, space - 3))].push_back(line.substr(space + 1));
        return;
    }
    delivered_.emplace_back(on, std::move(line));
    nats_.at(nats_.now(), [this, life = life_] { // if it is not done at the end of `receive`
        if (life == life_) {
            for (const auto& [where, text] : std::exchange(delivered_, {})) {
                serve(where, text);
            }
        }
    });
}

void site::reply(const bridge_link& on, std::uint64_t id, const std::string& rest) {
    bridge_->on_line(on, "id=" + std::to_string(id) + " " + rest, nats_.now());
}

void site::serve(const bridge_link& on, const std::string& line) {
    if (serves) {
        serves(on, line);
        return;
    }
    protocol::request_line r;
    protocol::malformed_request wrong;
    if (!protocol::parse_request(line, r, wrong)) {
        logged.push_back("the node cannot read: " + line);
        return;
    }
    constexpr std::string_view cancel = "cles/cancel/";
    if (r.noun.path.starts_with(cancel)) {
        const auto found = running_.find({on, std::stoull(std::string{r.noun.path.substr(cancel.size())})});
        if (found != running_.end()) {
            const auto id = found->first.second;
            cancelled.push_back(found->second);
            running_.erase(found);
            reply(on, id, R"({"error":"cancelled","message":"the request was cancelled"})");
        }
        return;
    }
    if (r.verb == verb::bind) {
        const auto noun = std::string{r.noun.target} + ":" + std::string{r.noun.path};
        if (r.unbinds()) {
            unbind(noun, on);
            reply(on, r.id, "{}");
        } else if (denied.contains(std::string{r.from})) {
            reply(on, r.id, R"({"error":"denied","message":"car9 does not allow it"})");
        } else if (r.noun.task == "none") {
            reply(on, r.id, R"({"error":"no_task","message":"no BIND 'none'"})");
        } else {
            bound.insert(noun);
            bound_on[noun].insert(on);
            reply(on, r.id, "{}");
        }
        return;
    }
    std::string body{r.body};
    ++executed[body];
    if (answer_after == milliseconds{0}) {
        reply(on, r.id, body.empty() ? "{}" : body);
        return;
    }
    running_.emplace(std::pair{on, r.id}, body);
    nats_.at(nats_.now() + answer_after, [this, life = life_, key = std::pair{on, r.id}] {
        if (const auto found = running_.find(key); life == life_ && found != running_.end()) {
            const auto text = found->second;
            running_.erase(found);
            reply(key.first, key.second, text.empty() ? "{}" : text);
        }
    });
}

void site::lose_pool(std::string_view pool, std::string_view) { lost.push_back("pool " + std::string{pool}); }

void site::lose_all(std::string_view) {
    lost.emplace_back("all");
    running_.clear();
    bound.clear();
    bound_on.clear();
    delivered_.clear();
}

void site::lose_binding(const bridge_link&, const std::string& noun, std::string_view) {
    lost.push_back("binding " + noun);
}

void site::log(log_level, const std::string& text) { logged.push_back(text); }

// -- of a secured fleet --------------------------------------------------------------------------------------------

bool site::may_forward(std::string_view member) const { return !distrusted.contains(std::string{member}); }

std::string site::how_to_permit(std::string_view member) const { return "(permit " + std::string{member} + ")"; }

std::optional<protocol::failure> site::refusal(std::string_view member, const protocol::request_line& bind) const {
    const auto from = bind.from.empty() ? "-" : std::string{bind.from};
    binds.push_back(std::string{member} + " " + from + " " + std::string{bind.noun.target} + ":" +
                    std::string{bind.noun.path});
    return bind.noun.task == "secret" ? std::optional{protocol::failure{.code = errc::denied, .message = "secret"}}
                                      : std::nullopt;
}

void site::on_stated_roster(const bridge_id& by, std::uint32_t version) {
    rosters.push_back(by.instance + " " + std::to_string(version));
    channel_->on_stated_roster(by, version, nats_.now());
}

void site::on_stated_sessions(const bridge_id& by) {
    if (has_sessions && !states_sessions_only) {
        channel_->on_stated_sessions(by, nats_.now());
    }
}

void site::publish_questions() {
    for (const auto& each : channel_->take_questions()) {
        nats_.publish(each.subject, channel_->questions(), each.message);
    }
}

} // namespace cles::bridging::test
