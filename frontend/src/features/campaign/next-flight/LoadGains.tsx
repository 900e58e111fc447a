import { Button, Stack } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import { pathOf, useDownload } from "../../../api/files";
import type { Campaign } from "../../../api/types";
import { useVehicle } from "../../../api/vehicles";
import { useVehicleStatus } from "../../../live/store";
import { heldGains } from "../../../live/vehicleStatus";
import { gainText, NOTHING } from "../../../ui/format";
import { RESTORED } from "../../../ui/gains";
import { type Column, ListTable } from "../../../ui/ListTable";
import { Note } from "../../../ui/Note";
import { ErrorNotice } from "../../../ui/Notices";
import { CheckResult } from "../../fleet/VehicleReadings";
import { type GainToLoad, gainsToLoad } from "./finishedCampaign";

interface Props {
  campaign: Campaign;
  best: Readonly<Record<string, number>>;
  first: Readonly<Record<string, number>>;
}

const text = (value: number | undefined) => (value === undefined ? NOTHING : gainText(value));

const COLUMNS: Column<GainToLoad>[] = [
  { title: "Gain", isHeading: true, cell: ({ name }) => name },
  { title: "First", cell: ({ old }) => text(old) },
  { title: "Best", cell: ({ value }) => text(value) },
];

const ON_VEHICLE: Column<GainToLoad> = {
  title: "Vehicle now",
  isText: true,
  cell: ({ held, isOnVehicle }) => (
    <CheckResult passed={isOnVehicle}>{isOnVehicle ? "on the vehicle" : `differs: ${text(held)}`}</CheckResult>
  ),
};

/** The best gains as a file to load them from, and whether a connected vehicle has them. */
export function LoadGains({ campaign, best, first }: Props) {
  const file = useDownload(pathOf(campaign.id, "parameter-file"));
  const vehicle = useVehicle(campaign.vehicle.registered ? campaign.vehicle.id : null);
  const status = useVehicleStatus(vehicle?.id ?? null);
  const held = vehicle === null || status?.isCurrent !== true ? {} : heldGains(vehicle, status);
  const isRead = Object.keys(held).length > 0;
  return (
    <Stack gap={10}>
      <ListTable
        label="First and best gains"
        rows={gainsToLoad(best, first, held)}
        keyOf={({ name }) => name}
        columns={isRead ? [...COLUMNS, ON_VEHICLE] : COLUMNS}
      />
      {isRead && <Note fz="body">{RESTORED}</Note>}
      <Button
        variant="default"
        leftSection={<IconDownload size={18} aria-hidden />}
        loading={file.isPending}
        onClick={() => file.mutate()}
      >
        Download parameter file
      </Button>
      <ErrorNotice error={file.error} />
    </Stack>
  );
}
