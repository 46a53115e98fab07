"""Notifications to people: on hold, fault, warning, stop, finish, and after a crash. They never delay a run."""

from rig.unattended.notify.channels import Send, sender, senders
from rig.unattended.notify.delivery import NotSent
from rig.unattended.notify.message import Message, compose
from rig.unattended.notify.notifier import Failure, Notifier
from rig.unattended.notify.notify_file import NotifySettings, read_settings, secret_files

__all__ = [
    "Failure",
    "Message",
    "NotSent",
    "Notifier",
    "NotifySettings",
    "Send",
    "compose",
    "read_settings",
    "secret_files",
    "sender",
    "senders",
]
