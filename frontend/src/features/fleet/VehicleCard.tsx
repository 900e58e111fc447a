import { Anchor, Button, Group, Stack, Text } from "@mantine/core";
import { IconPlugConnected } from "@tabler/icons-react";
import { Link } from "wouter";
import { useVehicleRequest } from "../../api/fleet";
import type { Vehicle } from "../../api/types";
import { useVehicleStatus } from "../../live/store";
import { heldGains, linkText } from "../../live/vehicleStatus";
import { Aside } from "../../ui/Aside";
import { VehicleBadge } from "../../ui/Badges";
import { withUnit } from "../../ui/format";
import { gainsInBrackets } from "../../ui/gains";
import { ErrorNotice } from "../../ui/Notices";
import panel from "../../ui/Panel.module.css";
import classes from "./Fleet.module.css";
import { VehicleStateBadge } from "./VehicleStateBadge";

/** A vehicle in the list: state, gains, next action. */
export function VehicleCard({ vehicle }: { vehicle: Vehicle }) {
  const status = useVehicleStatus(vehicle.registered ? vehicle.id : null);
  const ask = useVehicleRequest(vehicle.id);
  const names = Object.keys(vehicle.safe_gains);
  const held = heldGains(vehicle, status);
  const isKnown = Object.keys(held).length > 0;
  const isLinked = vehicle.registered && vehicle.state !== "disconnected";
  return (
    <Group
      component="li"
      gap="10px 16px"
      className={`${panel["panel"]} ${classes["card"]}`}
      style={{ borderColor: vehicle.state === "quarantined" ? "var(--bad)" : undefined }}
    >
      <Stack gap={8} flex="999 1 340px">
        <Group gap="4px 12px">
          <VehicleBadge isReal={vehicle.is_real} />
          <Text component="h3" lh="inherit">
            <Anchor component={Link} to={`/vehicles/${vehicle.id}`} display="block" py={6}>
              {vehicle.name}
            </Anchor>
          </Text>
          <VehicleStateBadge vehicle={vehicle} />
        </Group>
        <Group component="dl" gap="6px 22px" align="stretch">
          {isLinked && <Fact title="Link" value={linkText(status)} />}
          {isLinked && <Fact title="Battery" value={withUnit(status?.status.batteryV, "V", 1)} />}
          {vehicle.registered && (isKnown || isLinked) && (
            <Fact
              title={isLinked ? "Current gains" : "Gains, last read"}
              value={isKnown ? gainsInBrackets(held, names) : "not read"}
            />
          )}
          <Fact title={`Safe ${names.join(", ")}`} value={gainsInBrackets(vehicle.safe_gains)} />
          {vehicle.registered && <Fact title="In control" value={vehicle.control?.operator ?? "no operator"} />}
        </Group>
        {vehicle.state === "quarantined" && <Aside tone="bad">{vehicle.concern}</Aside>}
        <ErrorNotice error={ask.error} />
      </Stack>
      {vehicle.registered && vehicle.actions.includes("connect") && (
        <Button
          variant="default"
          flex="1 0 auto"
          leftSection={<IconPlugConnected size={20} aria-hidden />}
          loading={ask.isPending}
          onClick={() => ask.mutate("connect")}
        >
          Connect
        </Button>
      )}
      {vehicle.state === "quarantined" && (
        <Button component={Link} to={`/vehicles/${vehicle.id}`} color="red" variant="outline" flex="1 0 auto">
          Open vehicle
        </Button>
      )}
    </Group>
  );
}

function Fact({ title, value }: { title: string; value: string }) {
  return (
    <div>
      <dt>{title}</dt>
      <Text component="dd" fw={550} fz="body">
        {value}
      </Text>
    </div>
  );
}
