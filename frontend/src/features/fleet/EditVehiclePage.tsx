import { Button, Group } from "@mantine/core";
import { useForm } from "@mantine/form";
import { useState } from "react";
import { Link, Redirect, useParams } from "wouter";
import { navigate } from "wouter/use-browser-location";
import { useReadOnlyReason } from "../../api/access";
import { useDeleteVehicle, useEditVehicle } from "../../api/fleet";
import { useCatalogue } from "../../api/queries";
import type { Catalogue, Vehicle, VehicleEdit } from "../../api/types";
import { useVehicles } from "../../api/vehicles";
import { FormPage, RequestForm } from "../../ui/FormPage";
import { ErrorNotice, ReadOnlyNotice } from "../../ui/Notices";
import { useTitle } from "../../ui/useTitle";
import { autopilotOf } from "./fleet";
import { AddressField, FurtherFields, furtherLabels, NameField, PLAIN_LABELS } from "./VehicleFields";

/** Name and settings of a disconnected vehicle; of any other its own page is shown, and of a deleted one the list. */
export function EditVehiclePage() {
  const vehicleId = Number(useParams()["vehicleId"]);
  const vehicles = useVehicles();
  const catalogue = useCatalogue();
  const vehicle = vehicles.data?.find(({ id }) => id === vehicleId);
  useTitle("Edit vehicle");
  if (vehicles.data && !vehicle) return <Redirect to="/vehicles" replace />;
  if (vehicle && !vehicle.actions.includes("configure")) return <Redirect to={`/vehicles/${vehicleId}`} replace />;
  return (
    <FormPage
      title={`Edit ${vehicle?.name ?? "vehicle"}`}
      error={vehicles.error ?? catalogue.error}
      isPending={vehicles.isPending || catalogue.isPending}
    >
      {vehicle && catalogue.data && <EditForm vehicle={vehicle} catalogue={catalogue.data} />}
    </FormPage>
  );
}

function EditForm({ vehicle, catalogue }: { vehicle: Vehicle; catalogue: Catalogue }) {
  const { version, name, options } = vehicle;
  const form = useForm({
    initialValues: { version, name, options },
    transformValues: (values): VehicleEdit => ({ ...values, name: values.name.trim() }),
  });
  const edit = useEditVehicle(vehicle.id);
  return (
    <RequestForm
      form={form}
      labels={{ ...PLAIN_LABELS, ...furtherLabels(catalogue) }}
      request={edit}
      onDone={() => navigate(`/vehicles/${vehicle.id}`)}
      actions={
        <Group>
          <DeleteVehicle vehicle={vehicle} />
          <Button component={Link} to={`/vehicles/${vehicle.id}`} variant="default" ms="auto">
            Cancel
          </Button>
          <Button type="submit" loading={edit.isPending}>
            Save
          </Button>
        </Group>
      }
    >
      <ReadOnlyNotice why={useReadOnlyReason(vehicle)} />
      <NameField {...form.getInputProps("name")} />
      <AddressField {...form.getInputProps("options.address")} />
      <FurtherFields
        catalogue={catalogue}
        autopilot={autopilotOf(vehicle)}
        input={(option) => form.getInputProps(`options.${option}`)}
      />
    </RequestForm>
  );
}

function DeleteVehicle({ vehicle }: { vehicle: Vehicle }) {
  const [isAsked, setAsked] = useState(false);
  const remove = useDeleteVehicle(vehicle, () => navigate("/vehicles"));
  return (
    <>
      {isAsked ? (
        <Button color="red" loading={remove.isPending} onClick={() => remove.mutate()}>
          Delete with its gain history and commands
        </Button>
      ) : (
        <Button variant="default" onClick={() => setAsked(true)}>
          Delete vehicle
        </Button>
      )}
      <ErrorNotice error={remove.error} />
    </>
  );
}
