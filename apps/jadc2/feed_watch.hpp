// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace jadc2 {

/// Whether a feed is silent. Times are s since 1970.
class feed_watch {
  public:
    /// \param silent_s without an update, after which the feed is silent
    explicit feed_watch(double silent_s) : silent_s_(silent_s) {}

    /// An update has come. \return whether the feed was silent
    bool heard(double now);
    /// The feed has ended, so that there is nothing to expect.
    void ended() { expects_ = false; }

    /// Whether to show now that it is silent: when it becomes so, and then once per second.
    bool shows_silence(double now);
    [[nodiscard]] double silence(double now) const { return now - heard_; }

  private:
    double silent_s_;
    double heard_ = 0;
    double next_ = 0; ///< when to show the silence
    bool expects_ = false;
    bool silent_ = false;
};

} // namespace jadc2
