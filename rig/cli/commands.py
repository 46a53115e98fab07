"""Every command, registered by being imported."""

import rig.cli.chart
import rig.cli.confirm
import rig.cli.data
import rig.cli.demo
import rig.cli.doctor
import rig.cli.export
import rig.cli.infer
import rig.cli.plan
import rig.cli.proving
import rig.cli.requests
import rig.cli.run
import rig.cli.service
import rig.cli.sim
import rig.cli.status
import rig.cli.verify
import rig.cli.watch  # noqa: F401
