// SPDX-License-Identifier: BSL-1.0
#include "node/secured/secured_protocol.hpp"

#include <cles/json_reader.hpp>

#include "node/local_node.hpp"
#include "node/secured/epoch_confirmation.hpp"
#include "node/secured/roster_exchange.hpp"
#include "node/secured/secured_link.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace cles::core {

secured_protocol::secured_protocol(node_state& host)
    : node_(host), confirmed_(host.bounds.peers), challenges_(host), announcer_(host) {}

void secured_protocol::start(local_node& host) {
    security_.emplace(host);
    signer_ = std::make_shared<request_signer>(host);
    host_ = &host;
}

void secured_protocol::stop() noexcept {
    host_ = nullptr;
    security_.reset();
    signer_.reset();
}

std::unique_ptr<link_security> secured_protocol::on_link(const std::shared_ptr<node_state>& host, line_sink& out,
                                                         outbound& asking, const identity& peer,
                                                         std::function<void(std::string_view line)> deliver) {
    return std::make_unique<secured_link>(host, confirmed_, out, asking, peer, std::move(deliver));
}

void secured_protocol::on_unanswered(std::string_view peer) {
    if (security_) {
        security_->visit(peer);
    }
}

detail::pending_ptr secured_protocol::watch(const outgoing_call& request, detail::pending_ptr operation) {
    return signer_ ? signer_->watch(request, std::move(operation)) : std::move(operation);
}

bool secured_protocol::cancel(std::uint64_t ticket) { return signer_ && signer_->cancel(ticket); }

std::optional<protocol::failure> secured_protocol::refusal(const identity& link, const protocol::request_line& request,
                                                           time_point& due, time_point now) {
    return challenges_.refusal(link, request, due, now);
}

bool secured_protocol::serve_reserved(reply_writer& replies, const protocol::request_line& r) {
    const auto& parameters = r.noun.parameters;
    if (parameters.size() == 1 && parameters[0] == "roster") {
        serve_roster(node_, replies, r);
    } else if (parameters.size() == 2 && parameters[0] == "announced") {
        serve_announced(node_, replies, r);
    } else {
        return false;
    }
    return true;
}

std::optional<bool> secured_protocol::must_be_signed(std::string_view publisher, std::string_view task) const {
    return must_be_signed(publisher, task, std::nullopt);
}

std::optional<bool> secured_protocol::must_be_signed(std::string_view publisher, std::string_view task,
                                                     std::optional<std::uint32_t> epoch) const {
    // A command with the key of a node has its name, but not its tasks.
    const auto own = publisher == node_.name ? std::optional{node_.tasks.is_signed(task)} : std::nullopt;
    if (own.value_or(false)) {
        return true;
    }
    const auto contains = [task](const std::vector<std::string>& tasks) {
        return std::ranges::find(tasks, task) != tasks.end();
    };
    if (const auto* const run = node_.peers.owner(publisher)) {
        return contains(run->announced.signed_tasks);
    }
    const auto* const said = confirmed_.find(publisher);
    return said != nullptr && said->epoch == epoch.value_or(said->epoch) ? std::optional{contains(said->signed_tasks)}
                                                                         : own;
}

update_check secured_protocol::check(const protocol::request_line& update, bool direct) const {
    const auto must = must_be_signed(update.noun.target, update.noun.task, update.epoch);
    if (!must && !direct) {
        return update_check::refused;
    }
    if (!must.value_or(false) && update.sig.empty()) {
        return update_check::unsigned_one;
    }
    std::string scratch;
    const auto path = protocol::canonical_path(update.noun, scratch);
    return node_.security->is_signed(member_of(node_, update.noun.target), path, *update.seq,
                                     protocol::epoch_text(*update.epoch), update.body, update.sig)
               ? update_check::signed_one
               : update_check::refused;
}

std::string secured_protocol::announce(announcement& said, std::uint64_t& seq, bool in_group, bool by_gossip) {
    return announcer_.announce(said, seq, in_group, by_gossip);
}

bool secured_protocol::on_load_report(const group_source& from, const protocol::request_line& report, time_point now) {
    node_load load;
    json_reader body{report.body.empty() ? std::string_view{"{}"} : report.body, node_.bounds.depth};
    if (!read_load(body, load) || !body.at_end()) {
        return false;
    }
    const auto found = node_.peers.apply_load(report.noun.target, *report.epoch, *report.seq, load, from, now);
    ++(found == membership::verdict::taken ? node_.counts.announcements_received : node_.counts.announcements_dropped);
    return true;
}

std::vector<std::string> secured_protocol::endpoints(const std::vector<group_port*>& in_group, bool all) {
    return host_ != nullptr ? endpoints_of_interfaces(*host_, in_group, all) : std::vector<std::string>{};
}

void secured_protocol::on_stated_roster(std::string_view node, std::uint32_t version, time_point now) {
    if (security_) {
        security_->ask_for_roster(node, version, now);
    }
}

std::unique_ptr<security_protocol> make_secured_protocol(node_state& host) {
    return std::make_unique<secured_protocol>(host);
}

} // namespace cles::core
