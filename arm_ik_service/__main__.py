"""`python -m arm_ik_service` is `arm-ik`."""

from arm_ik_service.cli import main

main()
